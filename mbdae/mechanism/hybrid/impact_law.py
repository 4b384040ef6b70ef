"""Impacts: velocity jumps at contacts that satisfy all other closures.

    v+ = v- + M^-1 (G^T P + U^T p),   G v+ + b = 0,   0 <= p  _|_  U v+ + e U v- >= 0

Newton's law for the approaching contact rows U. v+ is the nearest point, in the mass metric, to v- subject to
G v+ + b = 0 and U v+ >= -e U v-: least-distance programming, solved by non-negative least squares. v+ is unique, p may
not be. Rows that already separate are left out, otherwise energy could rise; if they approach afterwards, they impact
next.

With friction, the tangential impulse is p_t, |p_t| <= mu p, opposing the slip after the impact, or stopping it
(`friction_lcp`). Newton's law can then increase the energy, for e > 0 (Kane); in that case the run ends.

Sources: Moreau (1988), in Nonsmooth Mechanics and Applications; Lawson, Hanson, Solving Least Squares Problems (1974),
23.4.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...system import Array
from ...tolerances import MODE_ROUNDING, SOLUTION_ROUNDING, TRUNCATION, VISIBLE
from .friction_lcp import FrictionBound, solve_friction_lcp

nnls = lazy_import("scipy.optimize", "nnls")
ROUNDS = 200  # of successive impacts at one instant; the last one with e = 0


class FrictionRow(NamedTuple):
    """Tangential row of a contact with friction.

    Attributes:
        by: index of the contact row whose impulse limits it.
        row: G_t, (nv,).
        rate: its g_t.
        share: mu.
    """

    by: int
    row: Array
    rate: float
    share: float


class ImpactSolution(NamedTuple):
    """Solution of an impact problem.

    Attributes:
        v: velocities after the impact, (nv,).
        p: impulses of the contact rows, (m,), in N s, positive in the opening direction.
        P: impulses of the kept rows, (k,).
        work: work of all impulses in J: the change of kinetic energy.
        friction: impulses of the friction rows, (n,).
    """

    v: Array
    p: Array
    P: Array
    work: float
    friction: Array


def solve_impact(
    U: Array, kept: Array, b: Array, rows: Array, c: Array, e: Array, v: Array,
    frictional: Sequence[FrictionRow] = (), speed: float = 1.0,
) -> ImpactSolution:
    """Solve the impact problem: Newton restitution, contact rows and kept rows, Coulomb friction.

    Args:
        U: the Cholesky factor of M = U^T U, (nv, nv).
        kept: the rows G that are kept, (k, nv), possibly redundant.
        b: their g_t, (k,).
        rows: contact rows, (m, nv), in their opening direction.
        c: their g_t in that direction, (m,).
        e: coefficients of restitution, (m,).
        v: velocities before, (nv,).
        frictional: friction rows.
        speed: the largest of rows; `MODE_ROUNDING` and `VISIBLE` are fractions of it.

    Raises:
        StepError: if kept rows and contact rows contradict each other, or friction has no solution or increases the
            energy.
    """
    problem = _Impact(U, kept, b, rows, v, frictional, speed)
    x, work, still = U @ v, 0.0, problem.still  # x = M^1/2 v
    total, P, friction = np.zeros(len(rows)), np.zeros(len(kept)), np.zeros(len(frictional))
    for k in range(ROUNDS + 1):
        rates = problem.BU.T @ x + c
        if k and not (rates < -still).any():
            break
        last = k == ROUNDS
        which = np.arange(len(rows)) if last else np.flatnonzero(rates <= still)
        goal = -(0.0 if last else e[which]) * np.minimum(rates[which], 0.0) - c[which]
        new, p, q = problem.impact(x, which, goal)
        impulse = problem.pinv @ (new - x - problem.BU[:, which] @ p - problem.BT @ q)
        work += problem.work(x + new, which, p, q, impulse)
        total[which] += p
        friction += q
        P += impulse
        x = new
    if frictional and work > MODE_ROUNDING * float((U @ v) @ (U @ v)) and not (b.any() or c.any()):
        raise StepError("impact", "Newton's law with friction makes energy here, with restitution above 0")
    return ImpactSolution(np.linalg.solve(U, x), total, P, work, friction)


class _Impact:
    """The rows of an impact in x = M^1/2 v: columns of kept rows BG, contact rows BU and friction rows BT, (nv, ..)."""

    def __init__(
        self, U: Array, kept: Array, b: Array, rows: Array, v: Array, frictional: Sequence[FrictionRow], speed: float
    ) -> None:
        tangents = np.array([x.row for x in frictional])
        self.BG, self.BU, self.BT = (
            np.linalg.solve(U.T, X.T) if len(X) else np.zeros((len(v), 0)) for X in (kept, rows, tangents)
        )
        self.b, self.frictional = b, frictional
        self.Q, self.pinv = _range(self.BG)
        self.still, self.speed = MODE_ROUNDING * speed, speed
        self.size = float(np.linalg.norm(U @ v))

    def impact(self, x: Array, which: Array, goal: Array) -> tuple[Array, Array, Array]:
        """Return x after contact rows ``which`` reach speeds ``goal``, their impulses p and those of friction rows.

        Raises:
            StepError: if kept rows and contact rows contradict each other, or friction has no solution.
        """
        closed = x - self.pinv.T @ (self.BG.T @ x + self.b)
        A = self._across(self.BU[:, which])
        able = np.linalg.norm(A, axis=0) > TRUNCATION * np.linalg.norm(self.BU[:, which], axis=0)
        short = goal - self.BU[:, which].T @ closed
        short[(short > 0) & (short <= self.still)] = 0.0
        if (short[~able] > VISIBLE * self.speed).any():
            raise StepError("impact", "closures block the relative velocity of the impact")
        on = [i for i, row in enumerate(self.frictional) if row.by in which]
        if on:
            return self._with_friction(closed, which, A, short, on)
        p = np.zeros(len(which))
        p[able] = _least(A[:, able], short[able], self.size)
        return closed + A @ p, p, np.zeros(len(self.frictional))

    def _with_friction(
        self, closed: Array, which: Array, A: Array, short: Array, on: list[int]
    ) -> tuple[Array, Array, Array]:
        """Solve normal and tangential impulses together; ``on`` are the friction rows of contact rows ``which``."""
        T, m = self._across(self.BT[:, on]), len(which)
        frictional = [self.frictional[i] for i in on]
        slip = self.BT[:, on].T @ closed + np.array([row.rate for row in frictional])
        at = np.searchsorted(which, [row.by for row in frictional])
        limits = {m + j: FrictionBound(int(at[j]), row.share) for j, row in enumerate(frictional)}
        low, high = np.zeros(m + len(on)), np.full(m + len(on), np.inf)
        both = solve_friction_lcp(np.hstack([A, T]), np.append(-short, slip), low, high, limits)
        q = np.zeros(len(self.frictional))
        q[on] = both[m:]
        return closed + A @ both[:m] + T @ q[on], both[:m], q

    def _across(self, B: Array) -> Array:
        """Return what of columns the kept rows leave."""
        return B - self.Q @ (self.Q.T @ B)

    def work(self, twice: Array, which: Array, p: Array, q: Array, P: Array) -> float:
        """Return the work of impulses: each times the mean of its speeds before and after, ``twice`` their sum in x."""
        return float(p @ (self.BU[:, which].T @ twice) + q @ (self.BT.T @ twice) + P @ (self.BG.T @ twice)) / 2


def _range(B: Array) -> tuple[Array, Array]:
    """Return an orthonormal basis of the range of B (n, k), and its pseudoinverse (k, n)."""
    if not B.shape[1]:
        return np.zeros((len(B), 0)), np.zeros((0, len(B)))
    left, sizes, right = np.linalg.svd(B, full_matrices=False)
    r = int(np.count_nonzero(sizes > TRUNCATION * sizes[:1]))
    return left[:, :r], (right[:r].T / sizes[:r]) @ left[:, :r].T


def _least(A: Array, f: Array, size: float) -> Array:
    """Return p >= 0 (m,) for which x = A p, of a given size, is the shortest x with A^T x >= f.

    Raises:
        StepError: if no x satisfies all inequalities.
    """
    if not (f > 0).any():
        return np.zeros(len(f))
    sizes = np.linalg.norm(A, axis=0)
    An, fn = A / sizes, f / sizes
    scale = max(size, float(np.abs(fn).max()))
    E, last = np.vstack([An, fn / scale]), np.append(np.zeros(len(A)), 1.0)
    u, _ = nnls(E, last)
    rest = 1.0 - float(fn / scale @ u)
    if not rest > TRUNCATION:
        if f.max() <= VISIBLE * (1 + size):  # residual of a state at rest
            return np.zeros(len(f))
        raise StepError("impact", "no impulses separate all contacts of this impact")
    out = u > 0
    x = np.linalg.lstsq(An[:, out].T, fn[out], rcond=TRUNCATION)[0]  # to rounding, for this active set
    tight = An.T @ x <= fn + SOLUTION_ROUNDING * scale  # only rows that do not open faster can push
    p = np.zeros(len(f))
    p[tight], miss = nnls(An[:, tight], x)
    if miss > SOLUTION_ROUNDING * size or (An.T @ x < fn - SOLUTION_ROUNDING * scale).any():
        p = u / rest * scale
    return p / sizes
