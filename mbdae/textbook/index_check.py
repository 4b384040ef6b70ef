"""The index of a problem in Hessenberg form, from the ranks of g_y f_z and k_u."""

import numpy as np

from ..discovery import lazy_import
from ..errors import InputError
from ..system import Array
from ..tolerances import PIVOT_RANK

qr = lazy_import("scipy.linalg", "qr")


def require_index_2(title: str, g_y: Array, f_z: Array) -> None:
    """Require a regular g_y f_z, scaled by rows and columns of |g_y| |f_z|: the rank does not depend on units.

    Args:
        title: of the problem.
        g_y: (nz, ny) at the start.
        f_z: (ny, nz) at the start.

    Raises:
        InputError: for a singular one, with the components of z and g that depend on others or do not occur.
    """
    if not (np.isfinite(g_y).all() and np.isfinite(f_z).all()):
        raise InputError(f"f_z or g_y of {title!r} is not finite at the start")
    what = f"{title!r} does not have index 2 at the start: g_y f_z"
    _require_regular(what, g_y @ f_z, np.abs(g_y) @ np.abs(f_z), "z", "g")


def require_index_1(title: str, k_u: Array) -> None:
    """Require a regular k_u, scaled by its rows and columns.

    Args:
        title: of the problem.
        k_u: (nu, nu) at the start.

    Raises:
        InputError: for a singular one, with the components of u and k that depend on others or do not occur.
    """
    if not np.isfinite(k_u).all():
        raise InputError(f"k_u of {title!r} is not finite at the start")
    _require_regular(f"0 = k of {title!r} does not determine u at the start: k_u", k_u, np.abs(k_u), "u", "k")


def _require_regular(what: str, matrix: Array, sizes: Array, column: str, row: str) -> None:
    """Require a regular matrix (n, n), by pivoting.

    Args:
        what: the matrix, in words.
        matrix: rows and columns are divided by the largest of their sizes.
        sizes: of the entries, of the terms that may cancel in them, (n, n).
        column: letter of the columns.
        row: letter of the rows.
    """
    for axis in (1, 0):
        largest = sizes.max(axis, keepdims=True, initial=0.0)
        largest[largest == 0] = 1.0
        matrix, sizes = matrix / largest, sizes / largest
    names = []
    for a, name in ((matrix, column), (matrix.T, row)):  # dependent columns, and rows
        R, order = qr(a, mode="r", pivoting=True)
        rank = int((np.abs(R.diagonal()) > PIVOT_RANK).sum())
        names.append(", ".join(f"{name}.{i + 1}" for i in sorted(order[rank:].tolist())))
    if rank < len(matrix):
        raise InputError(
            f"{what} has rank {rank} of {len(matrix)}, "
            f"column {names[0]} and row {names[1]} depend on the others or are zero"
        )
