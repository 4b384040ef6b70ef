"""The index of a problem in Hessenberg form, from the rank of g_y f_z."""

import numpy as np
from scipy.linalg import qr

from ..errors import InputError
from ..system import Array
from ..tolerances import PIVOT_RANK


def require_index_2(title: str, g_y: Array, f_z: Array) -> None:
    """Require a regular g_y f_z, scaled by the rows of g_y and the columns of f_z: the rank is independent of units.

    Args:
        title: of the problem.
        g_y: (nz, ny) at the start.
        f_z: (ny, nz) at the start.

    Raises:
        InputError: for a singular one, with the components of z and g that depend on others or do not occur.
    """
    if not (np.isfinite(g_y).all() and np.isfinite(f_z).all()):
        raise InputError(f"f_z or g_y of {title!r} is not finite at the start")
    sizes = np.linalg.norm(g_y, axis=1)[:, None] * np.linalg.norm(f_z, axis=0)
    matrix = g_y @ f_z / np.where(sizes, sizes, 1.0)
    names = []
    for a, name in ((matrix, "z"), (matrix.T, "g")):  # dependent columns, and rows
        R, order = qr(a, mode="r", pivoting=True)
        rank = int((np.abs(R.diagonal()) > PIVOT_RANK).sum())
        names.append(", ".join(f"{name}.{i + 1}" for i in sorted(order[rank:].tolist())))
    if rank < len(matrix):
        raise InputError(
            f"{title!r} does not have index 2 at the start: g_y f_z has rank {rank} of {len(matrix)}, "
            f"column {names[0]} and row {names[1]} depend on the others or are zero"
        )
