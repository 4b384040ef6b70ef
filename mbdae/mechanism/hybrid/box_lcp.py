"""Active-set selection: Gauss's principle of least constraint over a box of multipliers.

    minimise  lam W lam/2 + lam c,   lower <= lam <= upper,   W = S A S^T,  c = S a + gamma_S

S are the rows that may become active, a the accelerations without them, A = M^-1 projected onto the null space of the
active rows. Rows with a multiplier between its bounds do not accelerate; rows at a bound accelerate with the sign that
the bound allows.

Source: Moreau (1966), Quadratic programming in mechanics, SIAM J. Control 4.
"""

import numpy as np

from ...discovery import lazy_import
from ...system import Array
from ...tolerances import ROUNDING, TRUNCATION

lsq_linear = lazy_import("scipy.optimize", "lsq_linear")
WELL_CONDITIONED = 0.1  # of two rows: least squared sine of their angle for a solution by normal equations


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
    A, b = C / sizes, -d / scale
    if len(c) == 1:
        x = np.clip(A[:, 0] @ b, *bounds)
    elif len(c) == 2 and 1 - (A[:, 0] @ A[:, 1]) ** 2 > WELL_CONDITIONED:
        x = _of_two(float(A[:, 0] @ A[:, 1]), (A.T @ b).tolist(), *(x.tolist() for x in bounds))
    else:
        x = lsq_linear(A, b, bounds, method="bvls", tol=ROUNDING, max_iter=100 * len(c)).x
    return x * scale / sizes


def _of_two(w: float, b: list[float], lower: list[float], upper: list[float]) -> Array:
    """Minimise (x^2 + 2 w x y + y^2)/2 - b_x x - b_y y over a box: inside, or on one of its sides."""
    inside = [(b[i] - w * b[1 - i]) / (1 - w * w) for i in (0, 1)]
    if all(lo <= x <= hi for lo, x, hi in zip(lower, inside, upper, strict=True)):
        return np.array(inside)
    sides = []
    for i, bound in ((k, x) for k in (0, 1) for x in (lower[k], upper[k]) if np.isfinite(x)):
        other = min(max(b[1 - i] - w * bound, lower[1 - i]), upper[1 - i])
        value = (bound * bound + other * other) / 2 + w * bound * other - b[i] * bound - b[1 - i] * other
        sides.append((value, (bound, other) if i == 0 else (other, bound)))
    return np.array(min(sides)[1])
