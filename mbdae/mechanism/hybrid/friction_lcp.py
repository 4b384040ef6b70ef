"""Multipliers with dry friction: tangential ones are bounded by the normal one of the same contact.

    minimise  |C x|^2/2 + c x,   lower <= x <= upper,   |x_t| <= mu |x_n|,   or x_t = d |x_n| for sliding contacts

With fixed limits mu |x_n| the problem in x is convex; a fixed-point iteration updates the limits from the normal
multipliers, damped where it cycles. It contracts where mu |W_tn| < W_nn for all contacts together; otherwise there may
be several solutions or none (Painleve paradox). If no solution is found, an error is raised.

Source: J. Haslinger, I. Hlavacek, J. Necas, Handbook of Numerical Analysis IV (1996), for the iteration; V. Acary,
B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), section 13.7.
"""

from typing import NamedTuple

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import ROUNDING, SOLUTION_ROUNDING
from .box_lcp import solve_box_lcp

SHARES = (1.0, 0.5, 0.2, 0.05)  # relaxation factors of the limits, tried in order
MOST = 60  # iterations with each; one reduces the error to about mu |W_tn|/W_nn of it
NEWTON = 8  # iterations; within one linear piece of the problem one is enough
WIDTH = 1e-3  # of a limit: finite-difference width


class FrictionBound(NamedTuple):
    """Friction bound of a multiplier.

    Attributes:
        by: index of the normal multiplier.
        share: mu in |x_t| <= mu |x_n|; or
        drag: x_t = drag |x_n| for sliding contacts; nan where the contact may stick.
    """

    by: int
    share: float
    drag: float = np.nan


def solve_friction_lcp(C: Array, c: Array, lower: Array, upper: Array, limits: dict[int, FrictionBound]) -> Array:
    """Return multipliers (k,), see the module and `mbdae.mechanism.hybrid.box_lcp.solve_box_lcp`.

    Args:
        C: M^1/2 A S^T, (nv, k).
        c: accelerations, or velocities after an impact, of the rows without load, (k,).
        lower: lower bounds of the multipliers, (k,); those in ``limits`` are ignored.
        upper: upper bounds of the multipliers, (k,).
        limits: friction bounds by index.

    Raises:
        StepError: if the limits do not converge.
    """
    if not limits:
        return solve_box_lcp(C, c, lower, upper)
    problem = _Limited(C, c, lower, upper, limits)
    bound, last = np.where(problem.slides, 0.0, np.inf), np.inf
    for k, way in enumerate(np.repeat(SHARES, MOST)):
        x = problem.loads(bound)
        new = problem.limits(x)
        change, size = float(np.abs(new - bound).max()), float(new.max())
        if change <= ROUNDING * size or (change <= SOLUTION_ROUNDING * size and change >= last / 2):
            return x
        if k == MOST - 1 and (found := problem.newton(new)) is not None:
            return found
        bound, last = bound + way * (new - bound) if np.isfinite(bound).all() else new, change
    raise StepError("friction", "friction of contacts leaves no motion, or several")


class _Limited:
    """Multipliers for fixed limits, and the limits that follow from them."""

    def __init__(self, C: Array, c: Array, lower: Array, upper: Array, limits: dict[int, FrictionBound]) -> None:
        self.C, self.c, self.lower, self.upper = C, c, lower, upper
        self.at, self.by = np.array(list(limits)), np.array([x.by for x in limits.values()])
        self.share, self.drag = (np.array([getattr(x, k) for x in limits.values()]) for k in ("share", "drag"))
        self.slides = ~np.isnan(self.drag)

    def loads(self, bound: Array) -> Array:
        """Return the multipliers (k,) for given limits from the normal ones, (m,)."""
        x, at, slides = np.zeros(len(self.c)), self.at, self.slides
        x[at[slides]] = self.drag[slides] * bound[slides]
        none = at[~slides & (bound == 0)]
        free = np.setdiff1d(np.arange(len(x)), [*at[slides], *none])
        low, high = self.lower.copy(), self.upper.copy()
        low[at], high[at] = -bound, bound
        if len(free):
            C = self.C[:, free]
            x[free] = solve_box_lcp(C, self.c[free] + C.T @ (self.C @ x), low[free], high[free])
        return x

    def limits(self, x: Array) -> Array:
        """Return the limits that multipliers imply, (m,)."""
        return np.where(self.slides, 1.0, self.share) * np.abs(x[self.by])

    def newton(self, bound: Array) -> Array | None:
        """Return multipliers consistent with their limits by Newton's method, where the fixed-point iteration is slow.

        None if it fails, and where the limits grow faster than the limited loads.
        """
        for _ in range(NEWTON):
            x = self.loads(bound)
            new = self.limits(x)
            size = float(new.max())
            if float(np.abs(new - bound).max()) <= SOLUTION_ROUNDING * size:
                return x
            moves = np.diag(WIDTH * np.maximum(bound, size))
            S = np.eye(len(bound)) - np.array([(self.limits(self.loads(bound + m)) - new) / m.sum() for m in moves]).T
            if not np.linalg.det(S) > 0 or not (S.diagonal() > 0).all():
                return None
            bound = np.maximum(bound + np.linalg.solve(S, new - bound), 0.0)
        return None
