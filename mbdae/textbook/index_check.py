"""Check of the index of a problem in Hessenberg form, by the ranks of g_y f_z and k_u."""

import numpy as np

from ..discovery import lazy_import
from ..errors import InputError
from ..system import Array
from ..tolerances import PIVOT_RANK

qr = lazy_import("scipy.linalg", "qr")


def require_index_2(title: str, g_y: Array, f_z: Array) -> None:
    """Check that g_y f_z is nonsingular, scaled by rows and columns of |g_y| |f_z|: the rank does not depend on units.

    Args:
        title: title of the problem.
        g_y: partial derivatives at the start, (nz, ny).
        f_z: partial derivatives at the start, (ny, nz).

    Raises:
        InputError: if it is singular, with the components of z and g that depend on other ones or do not occur.
    """
    if not (np.isfinite(g_y).all() and np.isfinite(f_z).all()):
        raise InputError(f"f_z or g_y of {title!r} is not finite at the start")
    what = f"{title!r} does not have index 2 at the start: g_y f_z"
    _require_regular(what, g_y @ f_z, np.abs(g_y) @ np.abs(f_z), "z", "g")


def require_index_1(title: str, k_u: Array) -> None:
    """Check that k_u is nonsingular, scaled by its rows and columns.

    Args:
        title: title of the problem.
        k_u: partial derivatives at the start, (nu, nu).

    Raises:
        InputError: if it is singular, with the components of u and k that depend on other ones or do not occur.
    """
    if not np.isfinite(k_u).all():
        raise InputError(f"k_u of {title!r} is not finite at the start")
    _require_regular(f"0 = k of {title!r} does not determine u at the start: k_u", k_u, np.abs(k_u), "u", "k")


def _require_regular(what: str, matrix: Array, sizes: Array, column: str, row: str) -> None:
    """Check that a matrix (n, n) is nonsingular, by QR with pivoting.

    Args:
        what: description of the matrix.
        matrix: the matrix; its rows and columns are scaled by the largest of their ``sizes``.
        sizes: magnitudes of the terms that are summed in the entries, (n, n).
        column: name of the variables of the columns.
        row: name of the variables of the rows.
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
