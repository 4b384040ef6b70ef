"""Multipliers with Coulomb friction: tangential multipliers are bounded by the normal multiplier of the contact.

    minimize  |C x|^2/2 + c . x,   lower <= x <= upper,   |x_t| <= mu |x_n|,   or x_t = d |x_n| for sliding contacts

With fixed bounds mu |x_n| the problem in x is convex; a fixed-point iteration updates the bounds from the normal
multipliers, with relaxation if it cycles. It contracts where mu |W_tn| < W_nn for all contacts together; otherwise
there may be several solutions or none (Painleve paradox). An error is raised if no solution is found.

Source: J. Haslinger, I. Hlavacek, J. Necas, Handbook of Numerical Analysis IV (1996), for the iteration; V. Acary,
B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008), section 13.7.
"""

from typing import NamedTuple

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import ROUNDING, SOLUTION_ROUNDING
from .box_lcp import solve_box_lcp

RELAXATION = (1.0, 0.5, 0.2, 0.05)  # factors of the updates of the bounds, tried in order
MAX_ITERATIONS = 60  # iterations with each factor; each reduces the error by a factor of about mu |W_tn|/W_nn
MAX_NEWTON = 8  # Newton iterations; one is enough within a linear piece of the problem
WIDTH = 1e-3  # fraction of a bound: finite-difference width


class FrictionBound(NamedTuple):
    """Friction bound of a multiplier.

    Attributes:
        normal: index of the normal multiplier.
        friction: mu in |x_t| <= mu |x_n|; or
        sliding_ratio: x_t = d |x_n| for sliding contacts; nan where the contact may stick.
    """

    normal: int
    friction: float
    sliding_ratio: float = np.nan


def solve_friction_lcp(C: Array, c: Array, lower: Array, upper: Array, limits: dict[int, FrictionBound]) -> Array:
    """Return the multipliers (k,) with friction bounds; see `box_lcp.solve_box_lcp`.

    Args:
        C: M^1/2 A S^T, (nv, k).
        c: accelerations, or velocities after an impact, of the rows at lam = 0, (k,).
        lower: lower bounds of the multipliers, (k,); those in ``limits`` are ignored.
        upper: upper bounds of the multipliers, (k,).
        limits: friction bounds by index.

    Raises:
        StepError: if the bounds do not converge.
    """
    if not limits:
        return solve_box_lcp(C, c, lower, upper)
    problem = _BoundIteration(C, c, lower, upper, limits)
    bound, last_change = np.where(problem.slides, 0.0, np.inf), np.inf
    for k, relaxation in enumerate(np.repeat(RELAXATION, MAX_ITERATIONS)):
        x = problem.multipliers(bound)
        new = problem.bounds(x)
        change, size = float(np.abs(new - bound).max()), float(new.max())
        if change <= ROUNDING * size or (change <= SOLUTION_ROUNDING * size and change >= last_change / 2):
            return x
        if k == MAX_ITERATIONS - 1 and (found := problem.newton(new)) is not None:
            return found
        bound, last_change = bound + relaxation * (new - bound) if np.isfinite(bound).all() else new, change
    raise StepError("friction", "friction of contacts has no solution, or several")


class _BoundIteration:
    """Multipliers for fixed friction bounds, and the bounds that follow from them."""

    def __init__(self, C: Array, c: Array, lower: Array, upper: Array, limits: dict[int, FrictionBound]) -> None:
        self.C, self.c, self.lower, self.upper = C, c, lower, upper
        self.tangential, self.normal = np.array(list(limits)), np.array([x.normal for x in limits.values()])
        self.friction = np.array([x.friction for x in limits.values()])
        self.sliding_ratio = np.array([x.sliding_ratio for x in limits.values()])
        self.slides = ~np.isnan(self.sliding_ratio)

    def multipliers(self, bound: Array) -> Array:
        """Return the multipliers (k,) for given friction bounds, (m,)."""
        x, tangential, slides = np.zeros(len(self.c)), self.tangential, self.slides
        x[tangential[slides]] = self.sliding_ratio[slides] * bound[slides]
        free = np.ones(len(x), bool)
        free[tangential[slides | (bound == 0)]] = False
        low, high = self.lower.copy(), self.upper.copy()
        low[tangential], high[tangential] = -bound, bound
        if free.any():
            C = self.C[:, free]
            x[free] = solve_box_lcp(C, self.c[free] + C.T @ (self.C @ x), low[free], high[free])
        return x

    def bounds(self, x: Array) -> Array:
        """Return the friction bounds that follow from the multipliers, (m,)."""
        return np.where(self.slides, 1.0, self.friction) * np.abs(x[self.normal])

    def newton(self, bound: Array) -> Array | None:
        """Return multipliers consistent with their bounds by Newton's method, if the fixed-point iteration is slow.

        None if it fails, or if the bounds grow faster than the bounded multipliers.
        """
        for _ in range(MAX_NEWTON):
            x = self.multipliers(bound)
            new = self.bounds(x)
            size = float(new.max())
            if float(np.abs(new - bound).max()) <= SOLUTION_ROUNDING * size:
                return x
            steps = np.diag(WIDTH * np.maximum(bound, size))
            columns = [(self.bounds(self.multipliers(bound + d)) - new) / d.sum() for d in steps]
            S = np.eye(len(bound)) - np.array(columns).T
            if not np.linalg.det(S) > 0 or not (S.diagonal() > 0).all():
                return None
            bound = np.maximum(bound + np.linalg.solve(S, new - bound), 0.0)
        return None
