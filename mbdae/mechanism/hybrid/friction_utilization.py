"""Utilization of the stiction limit of a sticking row, also for redundant rows.

The crank and the slider of one loop may both stick: only a combination of their multipliers is determined, and the
minimum-norm solution is not meaningful. They stick as long as multipliers within all limits exist: the smallest
kappa with |lam_i| <= kappa F_i and G^T lam = const is the solution of a linear programme,

    min kappa,   -kappa F <= lam + N z <= kappa F,   N a basis of G^T N = 0,

and they slip together when it reaches 1. Its dual is kappa = max y^T lam over N^T y = 0, sum F_i |y_i| <= 1. If there
is only one direction y, as for sticking joints of a mechanism with one degree of freedom, kappa is the ratio of the
work of the multipliers to the work of the limits along y, and no programme is solved.

Source: P. Loetstedt, SIAM J. Appl. Math. 42 (1982), for non-unique multipliers.
"""

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...system import Array
from ...tolerances import SAME_STATE, UNINVOLVED

if TYPE_CHECKING:
    from .mode_point import ModePoint

linprog = lazy_import("scipy.optimize", "linprog")
ACTIVE_TOLERANCE = SAME_STATE  # fraction of kappa: slack of active inequalities


def friction_utilization(point: "ModePoint", row: int, limits: dict[int, float]) -> float:
    """Return |lam_i| / F_i of a sticking row; for redundant rows, their common kappa.

    Args:
        point: the point.
        row: index of the row.
        limits: F_i of all sticking rows by index.
    """
    lam, free = point.lam, point.null_multipliers
    if not free.shape[1] or np.abs(free[row]).max() < UNINVOLVED:
        return abs(float(lam[row])) / limits[row]
    rows = [k for k in limits if np.abs(free[k]).max() >= UNINVOLVED]
    F = np.array([limits[k] for k in rows])
    return least_utilization(lam[rows] / F, free[rows] / F[:, None])


def least_utilization(ratios: Array, N: Array) -> float:
    """Return the smallest kappa with |ratios + N z| <= kappa.

    Args:
        ratios: multipliers relative to their limits, with sign, (m,).
        N: null vectors, relative to the limits, (m, k).

    Raises:
        StepError: if the linear programme is not solved.
    """
    left, sizes, _ = np.linalg.svd(N)
    k, ones = int(np.count_nonzero(sizes > UNINVOLVED * sizes[:1])), np.ones((len(ratios), 1))
    basis, left_null = left[:, :k], left[:, k:]
    if left_null.shape[1] == 1:
        return float(abs(left_null[:, 0] @ ratios) / np.abs(left_null).sum())
    size = float(np.abs(ratios).max(initial=0.0))
    if size == 0 or not isfinite(size):
        return size
    relative = ratios / size  # tolerances of linprog are absolute, and it treats numbers above 1e20 as infinite
    A, b = np.block([[basis, -ones], [-basis, -ones]]), np.concatenate([-relative, relative])
    found = linprog(np.append(np.zeros(k), 1.0), A, b, bounds=(None, None), method="highs")
    if not found.success:
        raise StepError("friction", f"the utilization of redundant stiction limits is unknown: {found.message}")
    active = b - A @ found.x < ACTIVE_TOLERANCE * (1 + abs(found.x[-1]))
    return size * float(np.linalg.lstsq(A[active], b[active])[0][-1])  # the vertex, to rounding
