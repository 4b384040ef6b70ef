"""Active-set selection: the dual of Gauss's principle of least constraint, over a box of multipliers.

    minimize  lam^T W lam/2 + lam^T c,   lower <= lam <= upper,   W = S A S^T,  c = S a + gamma_S

W is the Delassus matrix, S the rows that may become active, a the accelerations without them, A = M^-1 projected onto
the null space of the active rows. Rows with a multiplier between its bounds do not accelerate; rows at a bound
accelerate with the sign that the bound allows. c = S A^1/2 d, unless dependent rows are inconsistent, such as the
contacts of a valve with its seat and with the cam that lifts it.

Source: Moreau (1966), Quadratic programming in mechanics, SIAM J. Control 4.
"""

import numpy as np

from ...discovery import lazy_import
from ...system import Array
from ...tolerances import MODE_ROUNDING, ROUNDING, TRUNCATION

lsq_linear = lazy_import("scipy.optimize", "lsq_linear")
MAX_ITERATIONS = 100  # per row
WELL_CONDITIONED = 0.1  # smallest squared sine of the angle between two rows for a solution by normal equations


def solve_box_lcp(C: Array, c: Array, lower: Array, upper: Array) -> Array:
    """Return the multipliers lam (k,) of the bounded problem.

    Args:
        C: M^1/2 A S^T, (nv, k): W = C^T C.
        c: accelerations of the rows at lam = 0, (k,).
        lower: lower bounds of the multipliers, (k,).
        upper: upper bounds of the multipliers, (k,).
    """
    d = np.linalg.lstsq(C.T, c, rcond=TRUNCATION)[0]
    sizes = np.linalg.norm(C, axis=0)
    sizes[~(sizes > TRUNCATION * sizes.max(initial=0.0))] = 1.0
    scale = float(np.linalg.norm(d)) or 1.0
    bounds = lower * sizes / scale, upper * sizes / scale
    A, b, c = C / sizes, -d / scale, c / (sizes * scale)
    if np.abs(A.T @ b + c).max(initial=0.0) > MODE_ROUNDING * np.abs(c).max(initial=0.0):
        x = _solve_contradicting_rows(A, c, *bounds)
    elif len(c) == 1:
        x = np.clip(A[:, 0] @ b, *bounds)
    elif len(c) == 2 and 1 - (A[:, 0] @ A[:, 1]) ** 2 > WELL_CONDITIONED:
        x = _solve_two_rows(float(A[:, 0] @ A[:, 1]), (A.T @ b).tolist(), *(x.tolist() for x in bounds))
    else:
        x = lsq_linear(A, b, bounds, method="bvls", tol=ROUNDING, max_iter=MAX_ITERATIONS * len(c)).x
    return x * scale / sizes


def _solve_two_rows(w: float, b: list[float], lower: list[float], upper: list[float]) -> Array:
    """Minimize (x^2 + 2 w x y + y^2)/2 - b_x x - b_y y over a box: inside, or on one of its sides."""
    inside = [(b[i] - w * b[1 - i]) / (1 - w * w) for i in (0, 1)]
    if all(lo <= x <= hi for lo, x, hi in zip(lower, inside, upper, strict=True)):
        return np.array(inside)
    sides = []
    for i, bound in ((k, x) for k in (0, 1) for x in (lower[k], upper[k]) if np.isfinite(x)):
        other = min(max(b[1 - i] - w * bound, lower[1 - i]), upper[1 - i])
        value = (bound * bound + other * other) / 2 + w * bound * other - b[i] * bound - b[1 - i] * other
        sides.append((value, (bound, other) if i == 0 else (other, bound)))
    return np.array(min(sides)[1])


def _solve_contradicting_rows(A: Array, c: Array, lower: Array, upper: Array) -> Array:
    """Minimize |A x|^2/2 + c . x over a box by active sets, where c has a component in the null space of A.

    Source: J. Nocedal, S. J. Wright, Numerical Optimization (2006), algorithm 16.3.
    """
    x, zero = np.clip(np.zeros(len(c)), lower, upper), MODE_ROUNDING * float(np.abs(c).max())
    free = (lower < x) & (x < upper)
    for _ in range(MAX_ITERATIONS * len(c)):
        gradient = A.T @ (A @ x) + c
        step, full = np.zeros(len(c)), 1.0
        if free.any():
            d = np.linalg.lstsq(A[:, free].T, gradient[free], rcond=TRUNCATION)[0]
            along = gradient[free] - A[:, free].T @ d
            unbounded = np.abs(along).max() > zero  # the objective decreases along it up to a bound
            full = np.inf if unbounded else 1.0
            step[free] = -along if unbounded else np.linalg.lstsq(A[:, free], -d, rcond=TRUNCATION)[0]
        distance = np.where(step > 0, upper, lower) - x
        fraction = np.divide(distance, step, out=np.full(len(c), np.inf), where=step != 0)
        blocking = int(fraction.argmin())
        if fraction[blocking] < full:
            x = x + fraction[blocking] * step
            x[blocking], free[blocking] = upper[blocking] if step[blocking] > 0 else lower[blocking], False
            continue
        x = x + step if np.isfinite(full) else x
        gradient = A.T @ (A @ x) + c
        release = np.where(free, 0.0, np.where(x <= lower, -gradient, gradient))
        if not release.max() > zero:
            break
        free[release.argmax()] = True
    return x
