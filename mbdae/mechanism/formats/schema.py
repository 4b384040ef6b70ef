"""Mechanism file: its keys with types and defaults; errors for unknown keys list the valid ones."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from ...errors import InputError, printable
from ..checked_table import HUGE, Table, one_line, tables_in
from ..closures import AnyClosure
from ..closures.clutch import Clutch
from ..closures.driver import Driver
from ..closures.unilateral_constraint import Stop
from ..flexible.beam import EndCondition, Plane
from ..forces import AnyForce
from ..hybrid.reset import Reset
from ..model_settings import OrderSettings, SolveSettings, Start, Value
from ..time_functions.input_functions import Input
from ..time_functions.time_functions import TimeFunction

Vector = tuple[float, float, float]
ReplacementKind = Literal[
    "revolute", "spherical", "planar", "translation", "free",
    "universal", "universal_xy", "universal_xz", "universal_yx", "universal_yz", "universal_zx", "universal_zy",
]  # fmt: skip
JointKind = Literal[
    "revolute", "continuous", "prismatic", "spherical", "planar", "translation", "universal", "free", "fixed"
]
BEAM = (
    "length", "young", "density", "area", "second_moment", "polar_moment", "shear_stiffness", "fibre", "modes",
    "elements", "ends", "plane", "axial", "damping", "stiffening", "loads",
)  # fmt: skip
WITH_AXIS = ("revolute", "continuous", "prismatic", "planar")


class Frame(Table):
    """An extra frame on a link.

    Attributes:
        name: name of the frame.
        parent: link, body, joint or frame to which it is attached, or ``"world"``.
        xyz: position in the parent frame, in m.
        rpy: rotation in the parent frame, in rad: roll, pitch, yaw as in URDF.
    """

    name: str
    parent: str
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


class Body(Frame):
    """An extra body and its joint; the joint and the link have the name of the body.

    Attributes:
        name: name of the joint, the link and the frame at the joint.
        joint: kind of the joint; a continuous joint is unbounded, a translation has the coordinates x, y and z.
        axis: axis of a revolute, continuous or prismatic joint, or normal of the plane of a planar joint.
        mass: mass in kg.
        com: centre of mass in the body's frame, in m.
        inertia: ixx, iyy, izz, ixy, ixz, iyz about the centre of mass, in kg m^2.
    """

    joint: JointKind = "revolute"
    axis: Vector = (0.0, 0.0, 1.0)
    mass: float = Field(default=0.0, ge=0)
    com: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float, float, float, float] = (0.0,) * 6

    @model_validator(mode="after")
    def _check_axis(self) -> "Body":
        if "axis" in self.model_fields_set and self.joint not in WITH_AXIS:
            raise ValueError(f"axis does not belong to a {self.joint} joint; rotate its frame by rpy")
        return self


class Flexible(Frame):
    """A straight elastic beam along x of its frame, see `mbdae.beam`, or a body from a file; nodes are ``name.node``.

    Attributes:
        name: name of the body and of the joint of its frame; ``"name.mode 1"``, ... are the joints of its modes.
        joint: kind of the joint between the parent and its frame; "fixed" clamps the frame to the parent.
        axis: axis of a revolute or prismatic joint.
        file: numbers of a modal body, ``"rod.npz"`` of `mbdae.save_modal_body`, in place of those of a beam.
        data: the same numbers as a table, as archives have them.
        length: m.
        young: Young's modulus in N/m^2.
        density: kg/m^3.
        area: area of the cross-section in m^2.
        second_moment: second moment of area for bending along y, and along z if it differs, in m^4.
        polar_moment: second moment of area about x in m^4; without it, or shear, no inertia about the axis.
        shear_stiffness: shear coefficient x shear modulus x area in N; 0 is rigid against shear.
        fibre: position (y, z) in the cross-section in m whose strain and stress nodes report.
        modes: number of normal modes.
        elements: number of elements.
        ends: displacements that the frame holds at the left and at the right end.
        plane: direction of bending, or both.
        axial: whether the beam stretches, too.
        damping: damping ratio of all modes, or of each.
        stiffening: whether bending shortens the beam, so that tension stiffens it and compression makes it buckle.
        loads: deflections by the weight in the frame, "gravity y", that further modes represent exactly.
        nodes: nodes and their positions along x in m, ends of elements; A and B at both ends if omitted.
    """

    joint: Literal["revolute", "prismatic", "spherical", "planar", "translation", "free", "fixed"] = "free"
    axis: Vector = (0.0, 0.0, 1.0)
    file: str = ""
    data: dict[str, Any] | None = None
    length: float | None = Field(default=None, gt=0)
    young: float | None = Field(default=None, gt=0)
    density: float | None = Field(default=None, gt=0)
    area: float | None = Field(default=None, gt=0)
    second_moment: float | tuple[float, float] | None = None
    polar_moment: float = Field(default=0.0, ge=0)
    shear_stiffness: float = Field(default=0.0, ge=0)
    fibre: tuple[float, float] = (0.0, 0.0)
    modes: int = Field(default=4, ge=1)
    elements: int = Field(default=8, ge=1)
    ends: EndCondition = "clamped"
    plane: Plane = "y"
    axial: bool = False
    damping: float | tuple[float, ...] = 0.0
    stiffening: bool = True
    loads: tuple[str, ...] = ()
    nodes: dict[str, float] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_body(self) -> "Flexible":
        fields = type(self).model_fields
        given = [x for x in (*BEAM, "nodes") if getattr(self, x) != fields[x].get_default(call_default_factory=True)]
        if self.file or self.data is not None:
            if given:
                raise ValueError(f"{given[0]} belongs to a beam, not to a body from a file")
        elif missing := [name for name in BEAM[:5] if getattr(self, name) is None]:
            raise ValueError(f"a beam needs {', '.join(missing)}; another body has a file")
        if "axis" in self.model_fields_set and self.joint not in ("revolute", "prismatic"):
            raise ValueError(f"axis does not belong to a {self.joint} joint; rotate its frame by rpy")
        return self


class Source(Table):
    """A file with joints and bodies: URDF, MJCF, or robot.yaml next to a robot.urdf.

    Attributes:
        file: relative to the mechanism file, or ``"example-robot-data:..."``.
        prefix: added to every name of the file.
        parent: frame to which it is attached: ``"world"`` or a frame of another source or body.
        xyz: position in the parent frame, in m.
        rpy: rotation in the parent frame, in rad.
        free_flyer: add a free joint between the world and the root link of a URDF.
        key: keyframe of an MJCF file with the initial state.
        quiet: report unsupported features of the file in ``mbdae info`` only, without a warning.
        packages: further folders from which files named in the source may be read, also by ``package://`` names.
    """

    file: str
    prefix: str = ""
    parent: str = "world"
    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    free_flyer: bool = False
    key: str = ""
    quiet: bool = False
    packages: tuple[str, ...] = ()


class MechanismFile(Table):
    """Contents of a mechanism.toml.

    Attributes:
        title: one line for tables and figures.
        source: name of a file, or tables ``[[source]]``; several sources are merged into one mechanism.
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
    gravity: Vector = (0.0, 0.0, -9.81)
    free_flyer: bool = False
    lock: dict[str, Value] = Field(default_factory=dict)
    joint_type: dict[str, ReplacementKind] = Field(default_factory=dict)
    motor: dict[str, TimeFunction] = Field(default_factory=dict)
    duration: float = Field(default=10.0, gt=0)
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
        known = {x["name"]: x for x in tables if isinstance(x, dict) and isinstance(x.get("name"), str)}
        return {k: _with_inputs(x, known) if k in ("driver", "force", "motor") else x for k, x in content.items()}

    @field_validator("source", mode="before")
    @classmethod
    def _as_sources(cls, source: object) -> object:
        if isinstance(source, str):
            return ({"file": source},)
        return (source,) if isinstance(source, dict | Source) else source or ()


def _with_inputs(value: Any, known: Mapping[str, Any]) -> Any:
    """Return the tables of a file with references to inputs replaced.

    Raises:
        ValueError: for an unknown input.
    """
    if isinstance(value, dict) and value.keys() == {"input"}:
        if value["input"] not in known:
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
    invalid = next(_invalid_values(content), None)
    if invalid is not None:
        raise InputError(f"{name}: {invalid} is beyond {HUGE:g} in magnitude, or contains control characters")
    try:
        return MechanismFile.model_validate(content)
    except ValidationError as e:
        raise InputError(f"{name}: {one_line(e, _known_keys, content)}") from None


def _invalid_values(value: object, path: str = "") -> Iterator[str]:
    """Yield the keys of numbers whose products would overflow, and of texts with control characters."""
    if isinstance(value, dict | list | tuple):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            if printable(str(key)) != str(key):
                yield str(key)
            yield from _invalid_values(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, str):
        if printable(value) != value:
            yield path
    elif isinstance(value, float | int) and abs(value) > HUGE and value not in (math.inf, -math.inf):
        yield path


def _known_keys(path: Sequence[object]) -> list[str]:
    """Return the keys of the table at a path of keys, numbers and kinds."""
    found: list[type[Table]] = [MechanismFile]
    for key in path:
        of_kind = [t for t in found if "kind" in t.model_fields and t.model_fields["kind"].default == key]
        inner = [x for t in found if key in t.model_fields for x in tables_in(t.model_fields[key].annotation)]
        found = of_kind or inner or found
    return sorted({key for table in found for key in table.model_fields})
