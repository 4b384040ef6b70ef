"""Solutions in files: .npz holds everything and can be read again, .csv is a table of named columns."""

import json
import sys
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from tokenize import TokenError
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile, is_zipfile

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import STATUS, InputError
from ..files import write_whole
from ..mechanism import Mechanism, Singular, describe, restore
from ..mechanism.tables import one_line
from ..tabular import write_csv
from ..textbook.problems import TEXTBOOK, listed
from .impact import Impact

if TYPE_CHECKING:
    from .solution import Solution

FORMAT = 2  # 1 held Pinocchio's archives, which are not safe to read
SUFFIXES = (".npz", ".csv")
DAMAGE = (
    OSError, ValueError, LookupError, ArithmeticError, EOFError, TypeError, AttributeError, RuntimeError, MemoryError,
    SyntaxError, TokenError, BadZipFile, zlib.error,
)  # fmt: skip


class _Lenient(BaseModel):
    """Data of a run: what is named here is checked, more may stand beside it."""

    model_config = ConfigDict(extra="allow", frozen=True)


class _Settings(_Lenient):
    method: str
    dense_order: int = Field(ge=1, le=20)
    formulation: str = "index2"
    project: bool = False
    baumgarte: tuple[float, float] | None = None
    step: float | None = None
    rtol: float | None = None
    q: tuple[float, ...] = ()
    v: tuple[float, ...] = ()
    s: tuple[float, ...] = ()


class _Stats(_Lenient):
    steps: int
    rejected: int | None
    f: int
    M: int
    G: int
    solves: int
    factorizations: int
    seconds: float
    backend: str


class _Run(_Lenient):
    """What a file says of a run beside its arrays."""

    mechanism: dict[str, Any]
    settings: _Settings
    stats: _Stats
    status: str
    message: str
    singular: tuple[Singular, ...] = ()
    in_use: tuple[tuple[int, tuple[int, ...]], ...] = ()
    modes: tuple[tuple[int, tuple[int, ...]], ...] = ()
    impacts: tuple[Impact, ...] = ()
    events: int = Field(default=0, ge=0)


def versions() -> dict[str, str]:
    """Versions of mbdae and of what computes for it."""
    return {name: version(name) for name in ("mbdae", "pin", "numpy", "scipy")}


def write(sol: "Solution", path: str | Path) -> None:
    """Write a solution as .npz without pickles, or its `mbdae.solution.columns.signals` as .csv.

    Raises:
        InputError: for a textbook problem, whose functions cannot be written, or an unwritable path.
    """
    if Path(path).suffix not in SUFFIXES:
        raise InputError(f"a solution is saved as {' or '.join(SUFFIXES)}, got {str(path)!r}")
    if Path(path).suffix == ".csv":
        write_csv(sol.signals(), path)
        return
    meta = {
        "format": FORMAT,
        "mechanism": described(sol.problem),
        "settings": sol.settings,
        "stats": sol.stats,
        "status": sol.status,
        "message": sol.message,
        "singular": [x.to_dict() for x in sol.singular],
        "in_use": sol.in_use,
        "modes": sol.modes,
        "impacts": sol.impacts,
        "events": len(sol.events),
        "versions": versions(),
        "command": sys.argv,
    }
    ts, ys, zs = sol.steps or (sol.t[:0], sol.y[:0], sol.z_own[:0])
    arrays = {"t": sol.t, "y": sol.y, "z_own": sol.z_own, "steps_t": ts, "steps_y": ys, "steps_z": zs}
    for i, found in enumerate(sol.events):
        arrays |= dict(zip(_event(i), (np.asarray(x) for x in found), strict=True))
    with write_whole(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)


def described(problem: Any) -> dict[str, Any]:
    """What makes a problem again, as data for JSON.

    Raises:
        InputError: for a textbook problem of the user's.
    """
    if isinstance(problem, Mechanism):
        return describe(problem)
    if not listed(problem):
        known = ", ".join(TEXTBOOK)
        raise InputError(f"the functions of {problem.title!r} cannot be written; by name those of {known} are")
    return {"textbook": problem.name}


def _restored(data: dict[str, Any]) -> tuple[Any, int, int]:
    """The problem, the length of its points, and that of its multipliers."""
    if "textbook" in data:
        problem = TEXTBOOK[data["textbook"]]()
        return problem, len(problem.y0), len(problem.z0)
    mech = restore(data)
    return mech, mech.nq + mech.nv + len(mech.states) + 1, mech.ng


def read(path: str | Path) -> dict[str, Any]:
    """Read a .npz file; returns the arguments of `mbdae.Solution`. A file of another mbdae is read with a warning.

    Raises:
        InputError: for a file that is missing, damaged, of another kind, or of a newer format.
    """
    with _damage(path):
        data, meta = _content(path)
    _check_version(path, meta)
    with _damage(path):
        return _arguments(data, meta)


def _content(path: str | Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of a file, and what it says of them."""
    if Path(path).exists() and not is_zipfile(path):
        raise BadZipFile("expected a .npz file, as `mbdae run MODEL -o run.npz` or Solution.save writes it")
    with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        data = {name: file[name] for name in file.files}
    meta = json.loads(str(data.pop("meta")))
    if not {"format", "versions"} <= meta.keys() or not isinstance(meta["versions"]["mbdae"], str):
        raise ValueError("its format or version is missing")
    return data, meta


def _arguments(data: dict[str, np.ndarray], meta: dict[str, Any]) -> dict[str, Any]:
    run = _Run.model_validate(meta)
    problem, width, ng = _restored(run.mechanism)
    for t, y, z in (("t", "y", "z_own"), ("steps_t", "steps_y", "steps_z")):
        _check_arrays(data[t], data[y], data[z], width, ng)
    events = [(data[t], data[y]) for t, y in map(_event, range(run.events))]
    for times, points in events:
        _check_arrays(times, points, np.empty((len(times), ng)), width, ng)
    if not len(data["t"]) and not len(data["steps_t"]):
        raise ValueError("the run has no times")
    if run.status not in STATUS:
        raise ValueError(f"status {run.status!r}; known: {', '.join(STATUS)}")
    if any(not 0 <= k < ng for _, rows in run.in_use for k in rows):
        raise ValueError("rows are in use that the mechanism does not have")
    lengths = getattr(problem, "nq", 0), getattr(problem, "nv", 0), len(getattr(problem, "states", ()))
    start = run.settings.q, run.settings.v, run.settings.s
    if any(len(x) not in (0, n) for x, n in zip(start, lengths, strict=True)):
        raise ValueError("start values that the mechanism does not have")
    sizes = [len(s.states) for s in getattr(problem, "switches", ())]
    if any(len(m) != len(sizes) or any(not 0 <= k < n for k, n in zip(m, sizes, strict=True)) for _, m in run.modes):
        raise ValueError("modes that the mechanism does not have")
    steps = (data["steps_t"], data["steps_y"], data["steps_z"]) if len(data["steps_t"]) else None
    arrays = {name: data[name] for name in ("t", "y", "z_own")}
    rest = {name: meta[name] for name in ("status", "message", "stats", "settings")}
    passed, in_use = list(run.singular), list(run.in_use)
    rest |= {"modes": list(run.modes), "impacts": list(run.impacts)}
    rest |= {"events": events, "singular": passed, "in_use": in_use}
    return {"problem": problem, **arrays, **rest, "steps": steps}


def _event(i: int) -> tuple[str, str]:
    """Names of the arrays of an event: times (k,) and points (k, ...)."""
    return f"event_{i}_t", f"event_{i}_y"


@contextmanager
def _damage(path: str | Path) -> Iterator[None]:
    """Say in one line what is wrong with a file."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except DAMAGE as e:
        words = one_line(e, lambda at: []) if isinstance(e, ValidationError) else (str(e).splitlines() or [""])[0]
        reason = words if isinstance(e, ValidationError | InputError) else f"{type(e).__name__}: {words}".strip(": ")
        raise InputError(f"{path} is damaged or not a solution written by mbdae ({reason})") from None


def _check_arrays(t: np.ndarray, y: np.ndarray, z: np.ndarray, width: int, ng: int) -> None:
    """Refuse what is not numbers for each time: t (n,) in order, y (n, width), z (n, ng) or (n, 2 ng)."""
    if any(x.dtype != float for x in (t, y, z)):
        raise ValueError("expected arrays of real numbers")
    n = len(np.atleast_1d(t))
    if t.shape != (n,) or y.shape != (n, width) or z.shape not in ((n, ng), (n, 2 * ng)):
        shapes = f"{t.shape}, {y.shape} and {z.shape}"
        raise ValueError(f"arrays have shapes {shapes}, expected (n,), (n, {width}), (n, {ng})")
    if not (np.isfinite(t).all() and np.isfinite(y).all()) or len({*np.sign(np.diff(t)).tolist()} - {0.0}) > 1:
        raise ValueError("times are not in order, or points are not finite")


def _check_version(path: str | Path, meta: dict[str, Any]) -> None:
    written, here = meta["versions"]["mbdae"], version("mbdae")
    if meta["format"] != FORMAT:
        other = f"{path} was written by mbdae {written} in format {meta['format']}"
        raise InputError(f"{other}; this is mbdae {here}, which reads format {FORMAT}")
    if written != here:
        warnings.warn(f"{path} was written by mbdae {written}, and this is mbdae {here}", stacklevel=4)
