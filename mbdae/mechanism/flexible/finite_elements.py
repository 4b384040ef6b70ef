"""Bodies of finite-element programs: points, mass and stiffness matrices from the files of Exudyn and of CalculiX.

CalculiX writes ``job.sti``, ``job.mas`` and ``job.dof`` beside ``job.inp`` in a step ``*FREQUENCY,
SOLVER=MATRIXSTORAGE`` without boundary conditions: the upper triangles of both matrices, by rows that job.dof names as
node.direction.
Exudyn's ``FEMinterface.SaveToFile`` writes ``.npz`` files.

Source: G. Dhondt, CalculiX CrunchiX user's manual, *FREQUENCY; J. Gerstmayr, Exudyn user documentation, FEMinterface.
"""

import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from scipy.sparse import csr_array

from ...errors import InputError
from ...system import Array


@dataclass(frozen=True, eq=False)
class FiniteElements:
    """A body of finite elements, for `modal_body`.

    Attributes:
        points: (n, 3), positions of the nodes.
        M, K: mass and stiffness by displacements x, y, z of the nodes in turn, (3n, 3n), sparse.
        sets: indices of the nodes of each set by name.
    """

    points: Array
    M: csr_array
    K: csr_array
    sets: dict[str, list[int]] = field(default_factory=dict)


def read_finite_elements(path: str | Path) -> FiniteElements:
    """Return the body of a file: ``.npz`` of Exudyn's FEMinterface, or ``.inp`` of CalculiX with its stored matrices.

    Raises:
        InputError: for another suffix, a missing or an incomplete file.
    """
    path = Path(path)
    if path.suffix not in READERS:
        raise InputError(f"finite elements: {path.name}: valid files end with {', '.join(sorted(READERS))}")
    try:
        return READERS[path.suffix](path)
    except OSError as e:
        raise InputError(f"finite elements: {e.filename or path}: {e.strerror or e}") from None
    except (
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        AttributeError,
        BadZipFile,
        EOFError,
        pickle.UnpicklingError,
    ) as e:
        raise InputError(f"finite elements: {path.name} is incomplete or of another program: {e!r}") from None


def _calculix(path: Path) -> FiniteElements:
    position, sets = _mesh(path)
    degrees = [line.split(".") for line in path.with_suffix(".dof").read_text().split()]
    at = {number: i for i, number in enumerate(sorted({int(node) for node, _ in degrees}))}
    place = np.array([3 * at[int(node)] + int(direction) - 1 for node, direction in degrees])
    if len(place) != 3 * len(at):
        missing = 3 * len(at) - len(place)
        raise InputError(f"finite elements: {path.stem}.dof: {missing} displacements are held; store a free body")
    M, K = (_upper(path.with_suffix(suffix), place) for suffix in (".mas", ".sti"))
    named = {name: [at[i] for i in dict.fromkeys(ids) if i in at] for name, ids in sets.items() if name}
    return FiniteElements(np.array([position[number] for number in at]), M, K, named)


def _mesh(path: Path) -> tuple[dict[int, list[float]], dict[str, list[int]]]:
    """Return positions of nodes by number, and the numbers of each set by name."""
    position: dict[int, list[float]] = {}
    sets: dict[str, list[int]] = {}
    for keyword, options, rows in _cards(path):
        if keyword == "NODE":
            position |= {int(row[0]): [float(x) for x in (row[1:4] + ["0"] * 3)[:3]] for row in rows}
            sets.setdefault(options.get("NSET", ""), []).extend(int(row[0]) for row in rows)
        elif keyword == "NSET":
            sets.setdefault(options["NSET"], []).extend(_members(rows, "GENERATE" in options, sets))
    return position, sets


def _cards(path: Path) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Yield keyword, options and data rows of each card of an input file, in capitals."""
    lines = [x.strip().upper() for x in path.read_text().splitlines() if x.strip() and not x.strip().startswith("**")]
    starts = [i for i, x in enumerate(lines) if x.startswith("*")]
    for i, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        keyword, *options = (x.strip() for x in lines[i][1:].split(","))
        pairs = {y[0].strip(): y[-1].strip() for y in (x.split("=") for x in options)}
        yield keyword, pairs, [[x.strip() for x in row.split(",") if x.strip()] for row in lines[i + 1 : end]]


def _members(rows: list[list[str]], generate: bool, sets: dict[str, list[int]]) -> Iterator[int]:
    for row in rows:
        if generate:
            first, last, *step = map(int, row)
            yield from range(first, last + 1, *step)
        else:
            for x in row:
                yield from sets[x] if x in sets else [int(x)]


def _upper(path: Path, place: Array) -> csr_array:
    """Return a symmetric matrix from rows (i, j, value) of its upper triangle, i and j from 1."""
    data = np.loadtxt(path, ndmin=2)
    i, j, x = data[:, 0].astype(int) - 1, data[:, 1].astype(int) - 1, data[:, 2]
    off = i != j
    rows, columns = np.concatenate([i, j[off]]), np.concatenate([j, i[off]])
    return csr_array((np.concatenate([x, x[off]]), (place[rows], place[columns])), (len(place), len(place)))


class _Numbers(pickle.Unpickler):
    """Reads arrays and sparse matrices, and calls nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return a class of numpy or scipy that holds numbers."""
        if module.split(".")[0] in ("numpy", "scipy") and name in PICKLED:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} holds no numbers")


PICKLED = {"_reconstruct", "scalar", "ndarray", "dtype", "csr_matrix", "csr_array", "_frombuffer"}


def _exudyn(path: Path) -> FiniteElements:
    with ZipFile(path) as file:

        def value(name: str) -> Any:
            with file.open(f"{name}.npy") as stream:
                version = np.lib.format.read_magic(stream)  # type: ignore[arg-type]
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                read(stream)  # type: ignore[arg-type]
                return _Numbers(stream).load()

        nodes, sets = value("nodes").item(), value("nodeSets").tolist()
        M, K = (csr_array(value(name).item()) for name in ("massMatrix", "stiffnessMatrix"))
    if "Position" not in nodes:
        raise InputError(f"finite elements: {path.name}: nodes need 'Position', got {', '.join(map(repr, nodes))}")
    named = {x["Name"]: np.asarray(x["NodeNumbers"], int).tolist() for x in sets}
    return FiniteElements(np.asarray(nodes["Position"], float), M, K, named)


READERS: dict[str, Callable[[Path], FiniteElements]] = {".inp": _calculix, ".npz": _exudyn}
