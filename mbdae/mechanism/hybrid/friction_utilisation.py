"""How much of its limit a row carries that sticks, also where rows depend on each other.

The crank and the slider of one loop may both stick: what they carry together is known, what each of them carries is
not, and multipliers of least norm say nothing. They hold as long as there are multipliers within all limits: the
smallest kappa with |lam_i| <= kappa F_i, G^T lam = given, is a linear programme,

    min kappa,   -kappa F <= lam + N z <= kappa F,   N a basis of G^T N = 0,

and they let go together where it reaches 1.

Source: P. Loetstedt, SIAM J. Appl. Math. 42 (1982), for loads that are not unique.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog

from ...system import Array

if TYPE_CHECKING:
    from .mode_point import ModePoint

NONE = 1e-9  # of a unit of null vectors: what takes no part in them
ACTIVE = 1e-7  # of kappa: limits that are reached


def friction_utilisation(point: "ModePoint", row: int, limits: dict[int, float]) -> float:
    """Return |lam_i| / F_i of a row that sticks; where it depends on others, kappa of all of them.

    Args:
        point: the point.
        row: number of the row.
        limits: F_i of all rows that stick, by their numbers.
    """
    lam, free = point.lam, point.null_multipliers
    if not free.shape[1] or np.abs(free[row]).max() < NONE:
        return abs(float(lam[row])) / limits[row]
    rows = [k for k in limits if np.abs(free[k]).max() >= NONE]
    F = np.array([limits[k] for k in rows])
    return least_utilisation(lam[rows] / F, free[rows] / F[:, None])


def least_utilisation(load: Array, N: Array) -> float:
    """Return the smallest kappa with |load + N z| <= kappa.

    Args:
        load: loads as shares of their limits, (m,).
        N: how they change, (m, k).
    """
    left, sizes, _ = np.linalg.svd(N, full_matrices=False)
    basis = left[:, : int(np.count_nonzero(sizes > NONE * sizes[:1]))]
    k, ones = basis.shape[1], np.ones((len(load), 1))
    A, b = np.block([[basis, -ones], [-basis, -ones]]), np.concatenate([-load, load])
    found = linprog(np.append(np.zeros(k), 1.0), A, b, bounds=(None, None), method="highs")
    active = b - A @ found.x < ACTIVE * (1 + abs(found.x[-1]))
    return float(np.linalg.lstsq(A[active], b[active])[0][-1])  # a vertex, to rounding
