"""Dead points of driven mechanisms: configurations beyond which closures do not admit the motion of a driver."""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...linear_solve import lapack
from ...system import Array
from ...tolerances import AMBIGUOUS_PIVOT, INPUT_DIGITS, NEGLIGIBLE, THREE_DIGITS
from ..closures.independent_rows import mass_scaled

if TYPE_CHECKING:
    from .index2 import Index2System

REMAINING = 0.5  # largest fraction of the smallest singular value that may remain at an extrapolated dead point


def require_no_dead_point(system: "Index2System", t: float, y: Array, sign: float, step: float) -> None:
    """Reject a motion of drivers beyond a dead point in the next step, or within `THREE_DIGITS` of y.

    Where the rows of closures and drivers lose rank, with w^T G = 0 and w^T g_t != 0, no velocity satisfies
    G v + g_t = 0. With the singular value decomposition of the rows in use, G M^-1/2 = sum sigma w n^T, the component
    of M^1/2 v along n for the smallest sigma is x = -w^T g_t / sigma, its rate a = -w^T gamma / sigma. Before the dead
    point at t*, x = c (t* - t)^-1/2, so that t* - t = x / (2 a), and the remaining motion along n is x^2 / a. Where
    closures lose rank without a driver, w^T g_t is zero, up to rounding.

    Args:
        system: a workspace, with drivers.
        t: time in s.
        y: the point.
        sign: -1.0 for a run backwards in time, else 1.0.
        step: size of the next step in s, 0.0 under step-size control.

    Raises:
        StepError: names the drivers, and the time of the dead point.
    """
    rows = list(system.in_use)
    if not system.driven or not rows:
        return
    mech, (q, v) = system.mechanism, system.split(y)
    scales, g_t, gamma = mech.row_scales[rows], system.g_t(t)[rows], system.gamma(q, v, t)[rows]
    U, W, sigma, N = _decomposition(system, t, q, rows)
    rates = g_t / scales
    terms = W[-1] * rates
    driven = np.flatnonzero(np.abs(terms) > NEGLIGIBLE * np.abs(terms).max())
    if not abs(terms.sum()) > NEGLIGIBLE * np.abs(rates[driven]).max(initial=0.0):  # only closures lose rank
        return
    x, a = -terms.sum() / sigma[-1], -(W[-1] @ (gamma / scales)) / sigma[-1]
    if not sign * x * a > 0:  # speeds do not grow
        return
    remaining, motion = x / (2 * a), lapack().dgesv(U, N[:, -1])[2] * x**2 / a
    size = float(np.abs(motion / mech.coordinate_scales).max())
    if abs(remaining) > step and not size <= THREE_DIGITS:
        return
    smallest = _decomposition(system, t, system.manifold.integrate(q, motion), rows)[2][-1]
    if smallest > max(REMAINING * sigma[-1], AMBIGUOUS_PIVOT * sigma[0]):  # the motion of a driver itself is unbounded
        return
    names = " and ".join(dict.fromkeys(repr(mech.row_names[rows[i]]) for i in driven))
    exact = size * abs(remaining) <= INPUT_DIGITS * abs(t + remaining)
    when = f"at t = {t + remaining:.6g}" if exact else f"in the step after t = {t:.6g}"
    raise StepError("driver", f"{names} cannot be followed beyond a dead point {when}, where velocities are infinite")


def _decomposition(system: "Index2System", t: float, q: Array, rows: list[int]) -> tuple[Array, Array, Array, Array]:
    """Return U of M = U^T U, and the singular value decomposition of scaled rows: w in rows, sigma, n in columns."""
    U, G = system.inertia(t, q), system.jacobian()[rows]
    B = mass_scaled(U, G / system.mechanism.row_scales[rows, None])
    N, sigma, W = np.linalg.svd(B, full_matrices=False)
    return U, W, sigma, N
