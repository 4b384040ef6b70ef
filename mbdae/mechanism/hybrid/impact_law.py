"""Impacts: velocity jumps at contacts that satisfy all other closures.

    v+ = v- + M^-1 (G^T P + N^T p),   G v+ + b = 0,   0 <= p  _|_  (N v+ + c) + e (N v- + c) >= 0

Newton's impact law for the approaching contact rows N and the bilateral rows G; c and b are their g_t. v+ is the
point closest to v- in the mass metric with G v+ + b = 0 and N v+ + c >= -e (N v- + c): least-distance programming,
solved by non-negative least squares. v+ is unique; if p without friction is not, the minimum-norm p is chosen, as for
multipliers. Rows that already separate are excluded, because energy could increase otherwise; if they approach
afterwards, they impact next, together with the no-slip rows of the same contact.

With friction, the tangential impulse is p_t, |p_t| <= mu p, opposing the slip after the impact, or zero slip
(`friction_lcp`). Newton's law can then increase the energy for e > 0 (Kane); in that case the run ends.

Sources: Moreau (1988), in Nonsmooth Mechanics and Applications; Lawson, Hanson, Solving Least Squares Problems (1974),
23.4.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...system import Array
from ...tolerances import HALF_DIGITS, MODE_ROUNDING, SOLUTION_ROUNDING, TRUNCATION, VISIBLE
from ..closures.independent_rows import mass_scaled
from .friction_lcp import FrictionBound, solve_friction_lcp

nnls = lazy_import("scipy.optimize", "nnls")
MAX_IMPACTS = 200  # successive impacts at one instant; the last impact has e = 0


class FrictionRow(NamedTuple):
    """Tangential row of a contact with friction.

    Attributes:
        normal: index of the contact row whose impulse bounds it.
        row: G_t, (nv,).
        rate: g_t of the row.
        friction: mu.
    """

    normal: int
    row: Array
    rate: float
    friction: float


class ImpactStage(NamedTuple):
    """One of the successive impacts at an instant.

    Attributes:
        before: velocities before the impact, (nv,).
        after: velocities after the impact, (nv,).
        p: impulses of the contact rows, (m,).
        P: impulses of the bilateral rows, (k,).
        active: which bilateral rows take part, (k,).
        friction: impulses of the friction rows, (n,).
        restitution: effective coefficients, (m,): 0 for rows that do not approach, and after `MAX_IMPACTS`.
    """

    before: Array
    after: Array
    p: Array
    P: Array
    active: Array
    friction: Array
    restitution: Array


class ImpactSolution(NamedTuple):
    """Solution of an impact problem.

    Attributes:
        v: velocities after the impact, (nv,).
        p: impulses of the contact rows, (m,), in N s, positive in the opening direction.
        P: impulses of the bilateral rows, (k,).
        work: work of all impulses in J: the change of kinetic energy.
        friction: impulses of the friction rows, (n,).
        stages: the successive impacts, whose impulses add up to p, P and friction.
    """

    v: Array
    p: Array
    P: Array
    work: float
    friction: Array
    stages: tuple[ImpactStage, ...]


def solve_impact(
    U: Array,
    bilateral: Array,
    b: Array,
    rows: Array,
    c: Array,
    e: Array,
    v: Array,
    frictional: Sequence[FrictionRow] = (),
    speed: float = 1.0,
    conditions: Sequence[int] = (),
) -> ImpactSolution:
    """Solve the impact problem: Newton restitution, contact rows and bilateral rows, Coulomb friction.

    Args:
        U: the Cholesky factor of M = U^T U, (nv, nv).
        bilateral: bilateral rows G, (k, nv), possibly redundant.
        b: g_t of the bilateral rows, (k,).
        rows: contact rows, (m, nv), in their opening direction.
        c: g_t of the contact rows in that direction, (m,).
        e: coefficients of restitution, (m,).
        v: velocities before the impact, (nv,).
        frictional: friction rows.
        speed: largest speed of the rows; `MODE_ROUNDING` and `VISIBLE` are fractions of it.
        conditions: contact rows of the last bilateral rows, which take part only if their contact row does.

    Raises:
        StepError: if bilateral rows and contact rows contradict each other, or friction has no solution or increases
            the energy.
    """
    problem = _Impact(U, bilateral, b, rows, v, frictional, speed, conditions)
    x, work, rest_speed, stages = U @ v, 0.0, problem.rest_speed, list[ImpactStage]()  # x = M^1/2 v
    for k in range(MAX_IMPACTS + 1):
        rates = problem.BU.T @ x + c
        if k and not (rates < -rest_speed).any():
            break
        last = k == MAX_IMPACTS
        which = np.arange(len(rows)) if last else np.flatnonzero(rates <= rest_speed)
        effective = np.zeros(len(rows))
        effective[which] = np.where(rates[which] < 0, 0.0 if last else e[which], 0.0)
        target = -effective[which] * rates[which] - c[which]
        problem.select_bilateral(which)
        new, p, q = problem.impact(x, which, target)
        impulse = problem.pinv @ (new - x - problem.BU[:, which] @ p - problem.BT @ q)
        work += problem.work(x + new, which, p, q, impulse)
        total = np.zeros(len(rows))
        total[which] = p
        stages.append(ImpactStage(v, v := np.linalg.solve(U, new), total, impulse, problem.active, q, effective))
        x = new
    start = U @ stages[0].before
    if frictional and work > MODE_ROUNDING * float(start @ start) and not (b.any() or c.any()):
        raise StepError("impact", "Newton's law with friction increases the energy, for a restitution above 0")
    total, P, friction = (np.sum(x, axis=0) for x in zip(*((s.p, s.P, s.friction) for s in stages), strict=True))
    return ImpactSolution(v, total, P, work, friction, tuple(stages))


class _Impact:
    """Rows of an impact in x = M^1/2 v: the columns of bilateral, contact and friction rows BG, BU, BT, (nv, ..)."""

    def __init__(
        self,
        U: Array,
        bilateral: Array,
        b: Array,
        rows: Array,
        v: Array,
        friction: Sequence[FrictionRow],
        speed: float,
        conditions: Sequence[int],
    ) -> None:
        tangents = np.array([x.row for x in friction])
        self.BG, self.BU, self.BT = (mass_scaled(U, X.reshape(-1, len(v))) for X in (bilateral, rows, tangents))
        self.b, self.frictional, self.conditions = b, friction, np.array(conditions, int)
        self.rest_speed, self.speed = MODE_ROUNDING * speed, speed
        self.size = float(np.linalg.norm(U @ v))
        self.active, self.pinv, self.Q = np.zeros(len(b), bool), np.zeros(self.BG.T.shape), np.zeros((len(v), 0))

    def select_bilateral(self, which: Array) -> None:
        """Select the bilateral rows that take part in an impact of contact rows ``which``."""
        active = np.ones(len(self.b), bool)
        active[len(self.b) - len(self.conditions) :] = np.isin(self.conditions, which)
        if not np.array_equal(active, self.active):
            self.active, self.pinv = active, np.zeros(self.BG.T.shape)
            self.Q, self.pinv[active] = range_and_inverse(self.BG[:, active])

    def impact(self, x: Array, which: Array, target: Array) -> tuple[Array, Array, Array]:
        """Return x after contact rows ``which`` reach speeds ``target``, and impulses of contact and friction rows.

        Raises:
            StepError: if bilateral rows and contact rows contradict each other, or friction has no solution.
        """
        closed = x - self.pinv.T @ (self.BG.T @ x + self.b)
        A = project_out(self.Q, self.BU[:, which])
        independent = np.linalg.norm(A, axis=0) > TRUNCATION * np.linalg.norm(self.BU[:, which], axis=0)
        deficit = target - self.BU[:, which].T @ closed
        deficit[(deficit > 0) & (deficit <= self.rest_speed)] = 0.0
        if (deficit[~independent] > VISIBLE * self.speed).any():
            raise StepError("impact", "closures block the relative velocity of the impact")
        on = [i for i, row in enumerate(self.frictional) if row.normal in which]
        if on:
            return self._with_friction(closed, which, A, deficit, on)
        p = np.zeros(len(which))
        p[independent] = _least_distance(A[:, independent], deficit[independent], self.size)
        return closed + A @ p, p, np.zeros(len(self.frictional))

    def _with_friction(
        self, closed: Array, which: Array, A: Array, deficit: Array, on: list[int]
    ) -> tuple[Array, Array, Array]:
        """Solve normal and tangential impulses together; ``on`` are the friction rows of contact rows ``which``."""
        T, m = project_out(self.Q, self.BT[:, on]), len(which)
        frictional = [self.frictional[i] for i in on]
        slip = self.BT[:, on].T @ closed + np.array([row.rate for row in frictional])
        at = np.searchsorted(which, [row.normal for row in frictional])
        limits = {m + j: FrictionBound(int(at[j]), row.friction) for j, row in enumerate(frictional)}
        low, high = np.zeros(m + len(on)), np.full(m + len(on), np.inf)
        both = solve_friction_lcp(np.hstack([A, T]), np.append(-deficit, slip), low, high, limits)
        q = np.zeros(len(self.frictional))
        q[on] = both[m:]
        return closed + A @ both[:m] + T @ q[on], both[:m], q

    def work(self, x_sum: Array, which: Array, p: Array, q: Array, P: Array) -> float:
        """Return the work of impulses, each times the mean of its speeds before and after; x_sum = x- + x+."""
        work = p @ (self.BU[:, which].T @ x_sum) + q @ (self.BT.T @ x_sum) + P @ (self.BG.T @ x_sum)
        return float(work) / 2


def project_out(Q: Array, B: Array) -> Array:
    """Return the components of the columns B orthogonal to an orthonormal basis Q."""
    return B - Q @ (Q.T @ B)


def range_and_inverse(B: Array) -> tuple[Array, Array]:
    """Return an orthonormal basis of the range of B (n, k), (n, r), and the pseudoinverse of B, (k, n)."""
    if not B.shape[1]:
        return np.zeros((len(B), 0)), np.zeros((0, len(B)))
    left, sizes, right = np.linalg.svd(B, full_matrices=False)
    r = int(np.count_nonzero(sizes > TRUNCATION * sizes[:1]))
    return left[:, :r], (right[:r].T / sizes[:r]) @ left[:, :r].T


def _least_distance(A: Array, f: Array, size: float) -> Array:
    """Return p >= 0 (m,) such that x = A p is the shortest x with A^T x >= f; ``size`` is the scale of x.

    Raises:
        StepError: if no x satisfies all inequalities.
    """
    if not (f > 0).any():
        return np.zeros(len(f))
    sizes = np.linalg.norm(A, axis=0)
    An, fn = A / sizes, f / sizes
    scale = max(size, float(np.abs(fn).max()))
    E, unit = np.vstack([An, fn / scale]), np.append(np.zeros(len(A)), 1.0)
    u, _ = nnls(E, unit)
    residual = 1.0 - float(fn / scale @ u)
    if not residual > TRUNCATION:
        if f.max() <= VISIBLE * (1 + size):  # residual of a state at rest
            return np.zeros(len(f))
        raise StepError("impact", "no impulses separate all contacts of this impact")
    positive = u > 0
    x = np.linalg.lstsq(An[:, positive].T, fn[positive], rcond=TRUNCATION)[0]  # accurate to rounding
    active = An.T @ x <= fn + SOLUTION_ROUNDING * scale  # only rows that do not open faster can have an impulse
    p = np.zeros(len(f))
    p[active], misfit = nnls(An[:, active], x)
    if misfit > SOLUTION_ROUNDING * size or (An.T @ x < fn - SOLUTION_ROUNDING * scale).any():
        p = u / residual * scale
    if p.max() * VISIBLE > scale:  # rounding made dependent columns independent: minimum-norm impulses
        n, p = int(active.sum()), np.zeros(len(f))
        p[active] = nnls(np.vstack([An[:, active], HALF_DIGITS * np.eye(n)]), np.append(x, np.zeros(n)))[0]
    p /= sizes
    p[active] = _minimum_norm(A[:, active], p[active])
    return p


def _minimum_norm(A: Array, p: Array) -> Array:
    """Return the minimum-norm impulses (m,) >= 0 with the same A p: a contact at many points acts at all of them.

    They are p_0 + N z, p_0 the minimum-norm solution of any sign, N z the shortest such that none is negative.
    """
    _, values, right = np.linalg.svd(A)
    r = int(np.count_nonzero(values > TRUNCATION * values[:1]))
    N, size = right[r:].T, float(np.abs(p).max(initial=0.0))
    if not N.shape[1] or not size:
        return p
    p0 = (p - N @ (N.T @ p)) / size
    u, _ = nnls(np.vstack([N.T, -p0]), np.append(np.zeros(N.shape[1]), 1.0))
    positive = p0 + N @ (N.T @ u) / (1.0 + float(p0 @ u)) > MODE_ROUNDING
    out = np.zeros(len(p))
    out[positive] = np.linalg.lstsq(A[:, positive], A @ p, rcond=TRUNCATION)[0]  # accurate to rounding
    return out
