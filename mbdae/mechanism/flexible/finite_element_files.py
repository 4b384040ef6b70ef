"""Bodies of finite-element programs: points, mass and stiffness matrices from files of Exudyn and CalculiX.

CalculiX writes ``job.sti``, ``job.mas`` and ``job.dof`` next to ``job.inp`` in a step ``*FREQUENCY,
SOLVER=MATRIXSTORAGE`` without boundary conditions: the upper triangles of both matrices, whose rows job.dof lists as
node.direction. Only solid elements are supported: CalculiX replaces the nodes of beams and shells.
Exudyn's ``FEMinterface.SaveToFile`` writes ``.npz`` files.

Source: G. Dhondt, CalculiX CrunchiX user's manual, *FREQUENCY; J. Gerstmayr, Exudyn user documentation, FEMinterface.
"""

import pickle
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from scipy.sparse import csr_array, issparse

from ...errors import InputError, printable, require
from ...system import Array
from .calculix import calculix


@dataclass(frozen=True, eq=False)
class FiniteElements:
    """A body of finite elements, for `modal_body`.

    Attributes:
        points: positions of the nodes, (n, 3).
        M, K: sparse mass and stiffness matrices, (3n, 3n), of displacements x, y, z of each node.
        sets: indices of the nodes of each set by name.
    """

    points: Array
    M: csr_array
    K: csr_array
    sets: dict[str, list[int]] = field(default_factory=dict)


def read_finite_elements(path: str | Path) -> FiniteElements:
    """Return the body of a file: ``.npz`` of Exudyn's FEMinterface, or ``.inp`` of CalculiX with its stored matrices.

    Raises:
        InputError: for an unknown suffix, or a missing, incomplete or inconsistent file.
    """
    require(path, str | Path, "finite elements: the path of a file")
    path = Path(path)
    if path.suffix.lower() not in READERS:
        raise InputError(f"finite elements: {path.name}: valid files end with {', '.join(sorted(READERS))}")
    try:
        found = READERS[path.suffix.lower()](path)
    except InputError:
        raise
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
        raise InputError(
            f"finite elements: {path.name} is incomplete or of another program: {printable(f'{e!s:.120}')}"
        ) from None
    _require_consistent(found, path)
    return found


def _calculix(path: Path) -> FiniteElements:
    return FiniteElements(*calculix(path))


class _NumbersUnpickler(pickle.Unpickler):
    """Unpickler of arrays and sparse matrices that calls no other code."""

    def find_class(self, module: str, name: str) -> Any:
        """Return an allowed class of numpy or scipy."""
        if module.split(".")[0] in ("numpy", "scipy") and name in ALLOWED_CLASSES:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} does not hold numbers")


ALLOWED_CLASSES = {"_reconstruct", "scalar", "ndarray", "dtype", "csr_matrix", "csr_array", "_frombuffer"}


def _exudyn(path: Path) -> FiniteElements:
    with ZipFile(path) as file:

        def value(name: str) -> Any:
            with file.open(f"{name}.npy") as stream:
                version = np.lib.format.read_magic(stream)  # type: ignore[arg-type]
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                read(stream)  # type: ignore[arg-type]
                return _NumbersUnpickler(stream).load()

        nodes, sets = value("nodes").item(), value("nodeSets").tolist()
        stored = {name: value(name).item() for name in ("massMatrix", "stiffnessMatrix")}
    if dense := [name for name, x in stored.items() if not issparse(x)]:
        raise InputError(f"finite elements: {path.name}: {dense[0]} is not a sparse matrix")
    M, K = map(csr_array, stored.values())
    if "Position" not in nodes:
        raise InputError(f"finite elements: {path.name}: nodes need 'Position', got {', '.join(map(repr, nodes))}")
    found = {x["Name"]: np.asarray(x["NodeNumbers"], int).tolist() for x in sets}
    return FiniteElements(np.asarray(nodes["Position"], float), M, K, found)


def _require_consistent(found: FiniteElements, path: Path) -> None:
    """Reject points, matrices and sets of different nodes."""
    n, prefix = len(found.points), f"finite elements: {path.name}"
    shapes = found.points.shape, found.M.shape, found.K.shape
    if not n or shapes != ((n, 3), (3 * n, 3 * n), (3 * n, 3 * n)):
        raise InputError(
            f"{prefix}: points (n, 3), M and K (3n, 3n) have the shapes {shapes[0]}, {shapes[1]}, {shapes[2]}"
        )
    for name, nodes in found.sets.items():
        if not all(0 <= i < n for i in nodes):
            raise InputError(f"{prefix}: the set {name!r} has points other than 0 to {n - 1}")


READERS: dict[str, Callable[[Path], FiniteElements]] = {".inp": _calculix, ".npz": _exudyn}
