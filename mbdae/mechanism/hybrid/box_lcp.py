"""Active-set selection: Gauss's principle of least constraint over a box of multipliers.

    minimise  lam W lam/2 + lam c,   lower <= lam <= upper,   W = S A S^T,  c = S a + gamma_S

S are the rows that may carry load, a the accelerations without them, A = M^-1 projected onto the null space of the
active rows. Rows with a multiplier between its bounds do not accelerate; rows at a bound accelerate with the sign that
the bound allows.

Source: Moreau (1966), Quadratic programming in mechanics, SIAM J. Control 4.
"""

import numpy as np

from ...discovery import lazy_import
from ...system import Array
from ...tolerances import ROUNDING, TRUNCATION

lsq_linear = lazy_import("scipy.optimize", "lsq_linear")


def solve_box_lcp(C: Array, c: Array, lower: Array, upper: Array) -> Array:
    """Return the multipliers lam (k,) of the bounded problem.

    Args:
        C: M^1/2 A S^T, (nv, k): W = C^T C.
        c: accelerations of the rows without load, (k,).
        lower: lower bounds of the multipliers, (k,).
        upper: upper bounds of the multipliers, (k,).
    """
    d = np.linalg.lstsq(C.T, c, rcond=TRUNCATION)[0]
    sizes = np.linalg.norm(C, axis=0)
    sizes[~(sizes > TRUNCATION * sizes.max(initial=0.0))] = 1.0
    scale = float(np.linalg.norm(d)) or 1.0
    bounds = lower * sizes / scale, upper * sizes / scale
    if len(c) == 1:
        x = np.clip(-(C[:, 0] / sizes[0]) @ d / scale, *bounds)
    else:
        x = lsq_linear(C / sizes, -d / scale, bounds, method="bvls", tol=ROUNDING, max_iter=100 * len(c)).x
    return x * scale / sizes
