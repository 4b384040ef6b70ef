"""Solutions in files: .npz contains the complete solution and can be loaded; .csv is a table of named columns."""

import json
import sys
import warnings
import zlib
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo, is_zipfile

import numpy as np
from pydantic import Base64Bytes, BaseModel, ConfigDict, Field, ValidationError

from ..errors import STATUS, InputError
from ..file_io import atomic_write
from ..mechanism import Impact, Mechanism, Singular, describe, restore
from ..mechanism.checked_table import one_line
from ..mechanism.fmu.session import saved_states
from ..textbook.problems import TEXTBOOK, listed
from .provenance import versions

if TYPE_CHECKING:
    from .solution import Solution

Shape = tuple[int, ...]
HEADERS: dict[tuple[int, int], Callable[..., Any]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
FORMAT = 2  # format 1 contained Pinocchio's archives, which are not safe to read
SUFFIXES = (".npz", ".csv")
ARRAYS = ("t", "y", "z_own", "steps_t", "steps_y", "steps_z")  # in addition to the arrays of events
MAX_TEXT = 2**27  # bytes of the metadata of a file, four per character
LARGE, MAX_COMPRESSION = 2**28, 100  # bytes: smaller arrays are always read, larger ones up to this compression ratio
DAMAGE = (
    OSError, ValueError, LookupError, ArithmeticError, EOFError, TypeError, AttributeError, RuntimeError, MemoryError,
    SyntaxError, TokenError, BadZipFile, zlib.error,
)  # fmt: skip


class _OpenModel(BaseModel):
    """Data of a run: declared fields are checked, others may be present."""

    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)


class _Settings(_OpenModel):
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


class _Stats(_OpenModel):
    steps: int
    rejected: int | None
    f: int
    M: int
    G: int
    solves: int
    factorizations: int
    seconds: float
    backend: str


class _Run(_OpenModel):
    """Data of a run besides its arrays."""

    mechanism: dict[str, Any]
    settings: _Settings
    stats: _Stats
    status: str
    message: str
    singular: tuple[Singular, ...] = ()
    in_use: tuple[tuple[int, tuple[int, ...]], ...] = ()
    modes: tuple[tuple[int, tuple[int, ...]], ...] = ()
    impacts: tuple[Impact, ...] = ()
    resets: tuple[tuple[int, str], ...] = ()
    events: int = Field(default=0, ge=0)
    arrays: dict[str, tuple[int, ...]] | None = None
    external: dict[str, Base64Bytes] = Field(default_factory=dict)


def write(sol: "Solution", path: str | Path) -> None:
    """Write a solution as .npz without pickles, or its `mbdae.solution.signals.signals` as .csv.

    Raises:
        InputError: for a custom textbook problem, whose functions cannot be written, or an unwritable path.
    """
    if Path(path).suffix not in SUFFIXES:
        raise InputError(f"a solution is saved as {' or '.join(SUFFIXES)}, got {str(path)!r}")
    if Path(path).suffix == ".csv":
        sol.to_columns().write_csv(path)
        return
    ts, ys, zs = sol.steps or (sol.t[:0], sol.y[:0], sol.z_own[:0])
    arrays = {"t": sol.t, "y": sol.y, "z_own": sol.z_own, "steps_t": ts, "steps_y": ys, "steps_z": zs}
    for i, event in enumerate(sol.events):
        arrays |= dict(zip(_event(i), (np.asarray(x) for x in event), strict=True))
    meta = {
        "format": FORMAT,
        "mechanism": problem_data(sol.problem),
        "settings": sol.settings,
        "stats": sol.stats,
        "status": sol.status,
        "message": sol.message,
        "singular": [x.to_dict() for x in sol.singular],
        "in_use": sol.in_use,
        "modes": sol.modes,
        "impacts": sol.impacts,
        "resets": sol.resets,
        "events": len(sol.events),
        "arrays": {name: x.shape for name, x in arrays.items()},
        "external": {name: b64encode(x).decode() for name, x in sol.external.items()},
        "versions": versions(),
        "command": sys.argv,
    }
    with atomic_write(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, meta=np.array(json.dumps(meta)), **arrays)


def problem_data(problem: Any) -> dict[str, Any]:
    """Return JSON data from which a problem can be recreated.

    Raises:
        InputError: for a custom textbook problem.
    """
    if isinstance(problem, Mechanism):
        return describe(problem)
    if not listed(problem):
        names = ", ".join(TEXTBOOK)
        raise InputError(f"the functions of {problem.title!r} cannot be saved; those of {names} can")
    return {"textbook": problem.name}


def _restored(data: dict[str, Any], meshes: Sequence[Path]) -> tuple[Any, int, int]:
    """Return the problem, the number of components of its points, and of its multipliers."""
    if "textbook" in data:
        problem = TEXTBOOK[data["textbook"]]()
        return problem, len(problem.y0), len(problem.z0)
    mech = restore(data, meshes)
    return mech, mech.nq + mech.nv + len(mech.states) + 1, mech.ng


def read(path: str | Path, meshes: Sequence[str | Path] = ()) -> dict[str, Any]:
    """Read a .npz file; return the arguments of `mbdae.Solution`; warn about a file of another version of mbdae.

    Sizes are checked first: only the arrays of a run are unpacked, and only if they have the shapes in the metadata.

    Args:
        path: the file.
        meshes: folders from which meshes are read, besides the folder of the file and installed packages.

    Raises:
        InputError: for a missing or damaged file, another kind of file, or another format.
    """
    with _damage_reported(path):
        shapes, meta = _sizes(path)
    _check_version(path, meta)
    with _damage_reported(path):
        return _arguments(path, shapes, meta, [Path(path).absolute().parent, *map(Path, meshes)])


def _sizes(path: str | Path) -> tuple[dict[str, Shape], dict[str, Any]]:
    """Return the shapes of the arrays of a file, from their headers, and its metadata."""
    if Path(path).exists() and not is_zipfile(path):
        raise BadZipFile("expected a .npz file, as `mbdae solve MODEL -o run.npz` or Solution.save writes it")
    with ZipFile(path) as file:
        headers = {x.filename.removesuffix(".npy"): _header(file, x) for x in file.infolist()}
    shape, kind = headers.pop("meta")
    if shape or kind.kind != "U" or kind.itemsize > MAX_TEXT:
        raise ValueError(f"its metadata are not a text of at most {MAX_TEXT // 4} characters")
    meta = json.loads(str(_arrays(path, ["meta"])["meta"]))
    if not {"format", "versions"} <= meta.keys() or not isinstance(meta["versions"]["mbdae"], str):
        raise ValueError("its format or version is missing")
    if any(kind != np.dtype(float) for _, kind in headers.values()):
        raise ValueError("expected arrays of real numbers")
    shapes = {name: shape for name, (shape, _) in headers.items()}
    size, compressed = sum(8 * prod(shape) for shape in shapes.values()), Path(path).stat().st_size
    if size > LARGE and size > MAX_COMPRESSION * compressed:
        raise ValueError(f"its {compressed / 1e6:.3g} MB unpack to {size / 1e6:.3g} MB, too much for a run")
    return shapes, meta


def _header(file: ZipFile, entry: ZipInfo) -> tuple[Shape, np.dtype]:
    """Return shape and type of an array, without reading it."""
    if entry.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise BadZipFile("its compression is not that of numpy")
    with file.open(entry) as stream:
        version = np.lib.format.read_magic(stream)
        if version not in HEADERS:
            raise ValueError(f"an array of format {version}")
        shape, _, kind = HEADERS[version](stream)
    return shape, kind


def _arrays(path: str | Path, names: Iterable[str]) -> dict[str, np.ndarray]:
    with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        return {name: file[name] for name in names}


def _arguments(
    path: str | Path, shapes: dict[str, Shape], meta: dict[str, Any], meshes: Sequence[Path]
) -> dict[str, Any]:
    run = _Run.model_validate(meta)
    problem, width, ng = _restored(run.mechanism, meshes)
    names = [*ARRAYS, *(name for i in range(min(run.events, len(shapes))) for name in _event(i))]
    if unknown := sorted(shapes.keys() - {*names}):
        raise ValueError(f"unknown array {unknown[0]!r}")
    _check_run(run, shapes, width, ng)
    _check_indices(problem, run, ng)
    if run.arrays is not None and run.arrays != shapes:
        raise ValueError("its arrays do not have the shapes in its metadata")
    data = _arrays(path, names)
    events = [(data[t], data[y]) for t, y in map(_event, range(run.events))]
    for ts, ys in ((data["t"], data["y"]), (data["steps_t"], data["steps_y"]), *events):
        _check_points(ts, ys)
    steps = (data["steps_t"], data["steps_y"], data["steps_z"]) if len(data["steps_t"]) else None
    arrays = {name: data[name] for name in ("t", "y", "z_own")}
    metadata = {name: meta[name] for name in ("status", "message", "stats", "settings")}
    saved_states.store(run.external)
    metadata |= {"external": run.external}
    metadata |= {name: list(getattr(run, name)) for name in ("modes", "impacts", "resets", "singular", "in_use")}
    return {"problem": problem, **arrays, **metadata, "steps": steps, "events": events}


def _check_run(run: _Run, shapes: dict[str, Shape], width: int, ng: int) -> None:
    """Reject arrays with inconsistent shapes, a run without times, and an unknown status."""
    for t, y, z in (("t", "y", "z_own"), ("steps_t", "steps_y", "steps_z")):
        _check_shapes(shapes[t], shapes[y], shapes[z], width, ng)
    for t, y in map(_event, range(run.events)):
        _check_shapes(shapes[t], shapes[y], (*shapes[t], ng), width, ng)
    if not (shapes["t"][0] or shapes["steps_t"][0]):
        raise ValueError("the run has no times")
    if run.status not in STATUS:
        raise ValueError(f"status {run.status!r}; known: {', '.join(STATUS)}")


def _check_points(t: np.ndarray, y: np.ndarray) -> None:
    """Reject points that are not finite, and times that are not monotonic."""
    finite = np.isfinite(t).all() and np.isfinite(y).all()
    if not finite or len({*np.sign(np.diff(t)).tolist()} - {0.0}) > 1:
        raise ValueError("times are not in order, or points are not finite")


def _check_indices(problem: object, run: _Run, ng: int) -> None:
    """Reject rows, start values and modes that are invalid for the mechanism."""
    if any(not 0 <= k < ng for _, rows in run.in_use for k in rows):
        raise ValueError("rows in use that the mechanism does not have")
    lengths = getattr(problem, "nq", 0), getattr(problem, "nv", 0), len(getattr(problem, "states", ()))
    start = run.settings.q, run.settings.v, run.settings.s
    if any(len(x) not in (0, n) for x, n in zip(start, lengths, strict=True)):
        raise ValueError("start values that the mechanism does not have")
    sizes = [len(s.states) for s in getattr(problem, "switches", ())]
    if any(len(m) != len(sizes) or any(not 0 <= k < n for k, n in zip(m, sizes, strict=True)) for _, m in run.modes):
        raise ValueError("modes that the mechanism does not have")


def _event(i: int) -> tuple[str, str]:
    """Return the names of the arrays of an event: times (k,) and points (k, ...)."""
    return f"event_{i}_t", f"event_{i}_y"


@contextmanager
def _damage_reported(path: str | Path) -> Iterator[None]:
    """Report errors of a file in one line."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"no such file: {path}") from None
    except DAMAGE as e:
        text = one_line(e, lambda at: []) if isinstance(e, ValidationError) else (str(e).splitlines() or [""])[0]
        reason = text if isinstance(e, ValidationError | InputError) else f"{type(e).__name__}: {text}".strip(": ")
        raise InputError(f"{path} is damaged or not a solution written by mbdae ({reason})") from None


def _check_shapes(t: Shape, y: Shape, z: Shape, width: int, ng: int) -> None:
    """Reject shapes other than t (n,), y (n, width), z (n, ng) or (n, 2 ng)."""
    n = (*t, 0)[0]
    if t != (n,) or y != (n, width) or z not in ((n, ng), (n, 2 * ng)):
        raise ValueError(f"arrays have shapes {t}, {y} and {z}, expected (n,), (n, {width}), (n, {ng})")


def _check_version(path: str | Path, meta: dict[str, Any]) -> None:
    version, current = meta["versions"]["mbdae"], versions()["mbdae"]
    if meta["format"] != FORMAT:
        message = f"{path} was written by mbdae {version} in format {meta['format']}"
        raise InputError(f"{message}; this is mbdae {current}, which reads format {FORMAT}")
    if version != current:
        warnings.warn(f"{path} was written by mbdae {version}, and this is mbdae {current}", stacklevel=4)
