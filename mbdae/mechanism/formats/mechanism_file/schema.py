"""Schema of mechanism files: keys with types and defaults; errors for unknown keys list the valid keys."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from ....errors import InputError, printable
from ...checked_table import HUGE, Table, one_line, tables_in
from ...closures import AnyClosure
from ...closures.clutch import Clutch
from ...closures.driver import Driver
from ...closures.unilateral_constraint import Stop
from ...forces import AnyForce
from ...hybrid.reset import Reset
from ...key_units import Coordinates, Unit
from ...model_settings import OrderSettings, SolveSettings, Start, Value
from ...time_functions.input_functions import Input
from ...time_functions.time_functions import TimeFunction
from ..body_tables import Body, Flexible, Frame, Source, Vector
from .file_units import FileUnits

ReplacementKind = Literal[
    "revolute", "spherical", "planar", "translation", "free",
    "universal", "universal_xy", "universal_xz", "universal_yx", "universal_yz", "universal_zx", "universal_zy",
]  # fmt: skip
MAX_LEVELS = 40  # nesting of tables: more than any key needs, and well below the recursion limit of Python


class MechanismFile(Table):
    """Contents of a mechanism.toml.

    Attributes:
        title: title for tables and figures, one line.
        source: name of a file, or tables ``[[source]]``; several sources are merged into one mechanism.
        units: units of the numbers of this file; SI, with angles in rad, if omitted.
        gravity: gravitational acceleration in m/s^2, in world axes.
        free_flyer: add a free joint between the world and the root link of each source.
        lock: joints that are removed, locked at this value in rad or m.
        joint_type: joints of a URDF that are replaced by another kind.
        motor: controls of named inputs.
        duration: default duration of a run, in s.
        frame: extra frames.
        body: extra bodies with their joints.
        flexible: elastic beams.
        closure: loop closures.
        driver: joints or distances that follow a function of time.
        stop: limits of joint motions.
        clutch: one-way clutches and ratchets.
        event: events at which the state jumps.
        force: springs, dampers, motors, controllers.
        input: inputs of forces and drivers.
        start: initial state.
        order: settings of the order study.
        solve: settings of runs.
    """

    title: str = ""
    source: tuple[Source, ...] = ()
    units: FileUnits = FileUnits()
    gravity: Annotated[Vector, Unit("m/s^2")] = (0.0, 0.0, -9.81)
    free_flyer: bool = False
    lock: Annotated[dict[str, Value], Coordinates()] = Field(default_factory=dict)
    joint_type: dict[str, ReplacementKind] = Field(default_factory=dict)
    motor: Annotated[dict[str, TimeFunction], Unit("1")] = Field(default_factory=dict)
    duration: Annotated[float, Unit("s")] = Field(default=10.0, gt=0)
    frame: tuple[Frame, ...] = ()
    body: tuple[Body, ...] = ()
    flexible: tuple[Flexible, ...] = ()
    closure: tuple[AnyClosure, ...] = ()
    driver: tuple[Driver, ...] = ()
    stop: tuple[Stop, ...] = ()
    clutch: tuple[Clutch, ...] = ()
    event: tuple[Reset, ...] = ()
    force: tuple[AnyForce, ...] = ()
    input: tuple[Input, ...] = ()
    start: Start = Start()
    order: OrderSettings = OrderSettings()
    solve: SolveSettings = SolveSettings()

    @model_validator(mode="before")
    @classmethod
    def _inputs(cls, content: Any) -> Any:
        """Replace ``{ input = NAME }`` in drivers, forces and motors by the input of that name."""
        if not isinstance(content, Mapping) or not isinstance(tables := content.get("input", ()), list | tuple):
            return content
        named = [x for x in tables if isinstance(x, dict) and isinstance(x.get("name"), str)]
        known = {x["name"]: x for x in named}
        if len(known) < len(named):
            raise ValueError(f"inputs need different names, got {', '.join(x['name'] for x in named)}")
        out = {k: _with_inputs(x, known) if k in ("driver", "force") else x for k, x in content.items()}
        if isinstance(motors := content.get("motor"), Mapping):  # a motor may be named "input"
            out["motor"] = {name: _with_inputs(x, known) for name, x in motors.items()}
        return out

    @field_validator("source", mode="before")
    @classmethod
    def _as_sources(cls, source: object) -> object:
        if isinstance(source, str):
            return ({"file": source},)
        return (source,) if isinstance(source, dict | Source) else () if source is None else source


def _with_inputs(value: Any, known: Mapping[str, Any]) -> Any:
    """Return the tables of a file with references to inputs replaced.

    Raises:
        ValueError: for an unknown input.
    """
    if isinstance(value, dict) and value.keys() == {"input"}:
        if value["input"] not in list(known):  # it may be a list or a table
            raise ValueError(f"unknown input {value['input']!r}; known: {', '.join(known) or 'none, add an [[input]]'}")
        return {**known[value["input"]], "kind": "input"}
    if isinstance(value, dict):
        return {key: _with_inputs(x, known) for key, x in value.items()}
    return [_with_inputs(x, known) for x in value] if isinstance(value, list | tuple) else value


def read_toml(text: str, name: str) -> MechanismFile:
    """Read a mechanism file.

    Raises:
        InputError: one line with the key, the error, and the valid keys.
    """
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as e:  # ValueError: also a number with thousands of digits
        raise InputError(f"{name} is not TOML: {e}") from None
    return checked(content, name)


def checked(content: Mapping[str, object], name: str) -> MechanismFile:
    """Check the tables of a mechanism file.

    Raises:
        InputError: one line with the key, the error, and the valid keys.
    """
    try:
        invalid = next(_invalid_values(content), None)
        if invalid is None:
            return MechanismFile.model_validate(content)
    except ValidationError as e:
        raise InputError(f"{name}: {one_line(e, _known_keys, content)}") from None
    except RecursionError:
        raise InputError(f"{name}: its tables are nested too deeply") from None
    raise InputError(f"{name}: {invalid} is beyond {HUGE:g} in magnitude, or contains control characters")


def _invalid_values(value: object, path: str = "", level: int = 0) -> Iterator[str]:
    """Yield the keys of numbers whose products would overflow, and of texts with control characters.

    Raises:
        RecursionError: for more than `MAX_LEVELS` nested tables.
    """
    if level > MAX_LEVELS:
        raise RecursionError
    if isinstance(value, dict | list | tuple):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(key, str) and printable(key) != key:
                yield key
            yield from _invalid_values(inner, f"{path}.{key}" if path else str(key), level + 1)
    elif isinstance(value, str):
        if printable(value) != value:
            yield path
    elif isinstance(value, float | int) and abs(value) > HUGE and value not in (math.inf, -math.inf):
        yield path


def _known_keys(path: Sequence[object]) -> list[str]:
    """Return the keys of the table at a path of keys, indices and kinds."""
    found: list[type[Table]] = [MechanismFile]
    for key in path:
        of_kind = [t for t in found if "kind" in t.model_fields and t.model_fields["kind"].default == key]
        inner = [x for t in found if key in t.model_fields for x in tables_in(t.model_fields[key].annotation)]
        found = of_kind or inner or found
    return sorted({key for table in found for key in table.model_fields})
