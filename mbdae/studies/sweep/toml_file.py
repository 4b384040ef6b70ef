"""A sweep described by a TOML file.

    model = "slider_crank"                # a name, or a path relative to this file
    end = 5.0
    times = 501
    outputs = ["peak force.wrist pin", "final q.crank"]

    [random]
    n = 1000
    [random.parameters]
    frame.rod_tip.xyz.0 = { distribution = "normal", loc = 0.35, scale = 1e-3 }

Dotted names need no quotes, unless their parts contain blanks or dots.
"""

import tomllib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from ...discovery import is_model_name
from ...errors import InputError
from ...file_io import read_text
from ...mechanism.checked_table import Table, one_line
from ...mechanism.formats.mechanism_file.parametric import split
from ...mechanism.formats.model_library import PARAMETRIC, find
from .plan import RANGE, Parameters, Random
from .sweep_run import check_settings


class RandomTable(Table):
    """``[random]``: number of runs, and a distribution for each parameter, see `mbdae.Random`."""

    n: int = Field(ge=1)
    parameters: dict[str, Any]


class SweepTable(Table):
    """All keys of the file of a sweep; see `mbdae.sweep`.

    Attributes:
        model: a name, or a path relative to the file.
        end: end time in s; the duration of the model when left out.
        start: start time in s.
        times: number of times, or the times, at which signals are evaluated.
        outputs: results of each run.
        seed: seed of the sweep, see `mbdae.sweep`.
        executor: threads or processes.
        workers: number of workers.
        settings: arguments of `mbdae.solve`.
        grid: name = list of values, or { from, to, n }: all combinations.
        run: tables ``[[run]]``, each with name = value.
        random: a random sample.
    """

    model: str
    end: float | None = None
    start: float = 0.0
    times: int | tuple[float, ...] | None = None
    outputs: tuple[str, ...] = ()
    seed: int = Field(default=0, ge=0)
    executor: Literal["threads", "processes"] | None = None
    workers: int | None = Field(default=None, ge=1)
    settings: dict[str, Any] = Field(default_factory=dict)
    grid: dict[str, Any] | None = None
    run: tuple[dict[str, Any], ...] | None = None
    random: RandomTable | None = None


def read_sweep(path: str | Path) -> dict[str, Any]:
    """Read a file and return the arguments of `mbdae.sweep`.

    Raises:
        InputError: with the key, the error, and the known keys.
    """
    path = Path(path)
    try:
        table = SweepTable.model_validate(tomllib.loads(read_text(path)))
    except ValidationError as e:
        raise InputError(f"{path}: {one_line(e, _known_keys)}") from None
    except (ValueError, RecursionError) as e:
        if isinstance(e, InputError):
            raise
        raise InputError(f"{path} is not TOML: {e}") from None
    if table.start and table.end is None:
        raise InputError(f"{path}: start needs end")
    check_settings(list(table.settings))
    return {
        "model": _model(table.model, path),
        "parameters": _parameters(table, path),
        "t_span": None if table.end is None else (table.start, table.end),
        "times": table.times,
        "outputs": table.outputs,
        "seed": table.seed,
        "executor": table.executor,
        "workers": table.workers,
        **table.settings,
    }


def _model(name: str, path: Path) -> str:
    """Return the model of a file, relative to it if it exists there; warns before a Python file is run."""
    file, _ = split(name)
    if is_model_name(file) or not (path.parent / file).exists():
        return name
    found = find(str(path.parent / file))
    if found.suffix == PARAMETRIC:
        warnings.warn(f"{path}: the Python file {found} is run", stacklevel=3)
    return str(found) + name[len(file) :]


def _known_keys(at: Sequence[object]) -> list[str]:
    return sorted((RandomTable if at and at[0] == "random" else SweepTable).model_fields)


def _parameters(table: SweepTable, path: Path) -> Parameters:
    present = [name for name in ("grid", "run", "random") if getattr(table, name) is not None]
    if len(present) != 1:
        found = " and ".join(present) or "none"
        raise InputError(f"{path}: a sweep takes one of [grid], [[run]] or [random], got {found}")
    if table.random is not None:
        return Random(table.random.n, dotted(table.random.parameters))
    return dotted(table.grid) if table.grid is not None else [dotted(run) for run in table.run or ()]


def dotted(table: Mapping[str, object], prefix: str = "") -> dict[str, Any]:
    """Return nested tables as one table of dotted names; distributions and ranges are values."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping) and "distribution" not in value and set(value) != RANGE:
            out |= dotted(value, f"{name}.")
        else:
            out[name] = value
    return out
