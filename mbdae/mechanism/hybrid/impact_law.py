"""Impacts: velocities that jump where rows touch, with all loops kept shut.

    v+ = v- + M^-1 (G^T P + U^T p),   G v+ + b = 0,   0 <= p  _|_  U v+ + e U v- >= 0

Newton's law for the touched rows U that approach. v+ is the nearest point, in the mass metric, to v- among those that
meet G v+ + b = 0 and U v+ >= -e U v-: least-distance programming, solved by non-negative least squares. v+ is unique, p
need not be. Rows that separate already are left out, else energy could rise; those that then approach strike next.

Where a contact rubs its tangential impulse is p_t, |p_t| <= mu p, against the slip behind the impact, or what stops it
(`rubs`). Newton's law can make energy of that, for e > 0 (Kane): then it is no law, and the run ends.

Sources: Moreau (1988), in Nonsmooth Mechanics and Applications; Lawson, Hanson, Solving Least Squares Problems (1974),
23.4.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ...errors import StepError
from ...system import Array
from .friction_lcp import FrictionBound, solve_friction_lcp

STILL = 1e-10  # of 1 + |v|: a speed below is none
ROUNDS = 200  # of rows that strike one after another at one instant; the last one with e = 0
RANK = 1e-7  # of the largest singular value, and of a row: what is left of it beside others
SHARP = 1e-12  # of the speed: how well impulses are found again from velocities
CONTRADICTION = 1e-6  # of 1 + |v|: a speed that rows ask for which depend on others
GAIN = 1e-10  # of the kinetic energy: less is rounding


class FrictionRow(NamedTuple):
    """A tangential row of a contact that rubs.

    Attributes:
        by: number of the touched row whose impulse limits its own.
        row: G_t, (nv,).
        rate: its g_t.
        share: mu.
    """

    by: int
    row: Array
    rate: float
    share: float


class ImpactSolution(NamedTuple):
    """What an impact does.

    Attributes:
        v: velocities behind it, (nv,).
        p: impulses of the rows that were touched, (m,), in N s, in the direction in which they open.
        P: impulses of the rows that are kept, (k,).
        work: of all impulses in J: what the kinetic energy changes by.
        friction: impulses of the rows that rub, (n,).
    """

    v: Array
    p: Array
    P: Array
    work: float
    friction: Array


def velocity_tolerance(v: Array) -> float:
    """Return the speed below which nothing moves beside velocities v (nv,)."""
    return STILL * (1 + float(np.abs(v).max()))


def solve_impact(
    U: Array, kept: Array, b: Array, rows: Array, c: Array, e: Array, v: Array, rubs: Sequence[FrictionRow] = ()
) -> ImpactSolution:
    """Return what happens where rows touch.

    Args:
        U: the Cholesky factor of M = U^T U, (nv, nv).
        kept: the rows G that are kept, (k, nv), which may depend on each other.
        b: and their g_t, (k,).
        rows: the rows that touch, (m, nv), by the direction in which they open.
        c: and their g_t in that direction, (m,).
        e: restitution, (m,).
        v: velocities before, (nv,).
        rubs: rows that rub.

    Raises:
        StepError: where the kept rows and the touched ones contradict each other, or friction finds no impulse or makes
            energy.
    """
    n, m = len(v), len(rows)
    tangents = np.array([x.row for x in rubs])
    BG, BU, BT = (np.linalg.solve(U.T, X.T) if len(X) else np.zeros((n, 0)) for X in (kept, rows, tangents))
    friction = np.zeros(len(rubs))
    total, x, work = np.zeros(m), U @ v, 0.0  # x = M^1/2 v
    P = np.zeros(len(kept))
    Q, pinv = _range(BG)
    for k in range(ROUNDS + 1):
        speed = BU.T @ x + c
        still = velocity_tolerance(v)
        last = k == ROUNDS
        if k and not (speed < -still).any():
            break
        which = np.arange(m) if last else np.flatnonzero(speed <= still)
        goal = -(0.0 if last else e[which]) * np.minimum(speed[which], 0.0) - c[which]
        closed = x - pinv.T @ (BG.T @ x + b) if len(kept) else x
        A = BU[:, which] - Q @ (Q.T @ BU[:, which])
        able = np.linalg.norm(A, axis=0) > RANK * np.linalg.norm(BU[:, which], axis=0)
        short = goal - BU[:, which].T @ closed
        short[(short > 0) & (short <= still)] = 0.0
        if (short[~able] > CONTRADICTION * (1 + float(np.abs(v).max()))).any():
            raise StepError("impact", "closures keep what strikes from giving way")
        p, q = np.zeros(len(which)), np.zeros(len(rubs))
        on = [i for i, rub in enumerate(rubs) if rub.by in which]
        if on:
            T = BT[:, on] - Q @ (Q.T @ BT[:, on])
            slip = BT[:, on].T @ closed + np.array([rubs[i].rate for i in on])
            size, by = len(which), np.searchsorted(which, [rubs[i].by for i in on])
            limits = {
                size + j: FrictionBound(int(at), rubs[i].share) for j, (i, at) in enumerate(zip(on, by, strict=True))
            }
            low, high = np.zeros(size + len(on)), np.full(size + len(on), np.inf)
            both = solve_friction_lcp(np.hstack([A, T]), np.append(-short, slip), low, high, limits)
            p, q[on] = both[:size], both[size:]
            new = closed + A @ p + T @ q[on]
        else:
            p[able] = _least(A[:, able], short[able], float(np.linalg.norm(U @ v)))
            new = closed + A @ p
        impulse = pinv @ (new - x - BU[:, which] @ p - BT @ q) if len(kept) else P
        work += float(p @ (BU[:, which].T @ (x + new)) + q @ (BT.T @ (x + new)) + impulse @ (BG.T @ (x + new))) / 2
        total[which] += p
        friction += q
        P = P + impulse if len(kept) else P
        x = new
    if rubs and work > GAIN * float((U @ v) @ (U @ v)) and not (b.any() or c.any()):
        raise StepError("impact", "Newton's law with friction makes energy here, with restitution above 0")
    return ImpactSolution(np.linalg.solve(U, x), total, P, work, friction)


def _range(B: Array) -> tuple[Array, Array]:
    """An orthonormal basis of the range of B (n, k), and its pseudoinverse (k, n)."""
    if not B.shape[1]:
        return np.zeros((len(B), 0)), np.zeros((0, len(B)))
    left, sizes, right = np.linalg.svd(B, full_matrices=False)
    r = int(np.count_nonzero(sizes > RANK * sizes[:1]))
    return left[:, :r], (right[:r].T / sizes[:r]) @ left[:, :r].T


def _least(A: Array, f: Array, size: float) -> Array:
    """The p >= 0 (m,) for which x = A p, of about a size, is the shortest x with A^T x >= f.

    Raises:
        StepError: where no x meets all of them.
    """
    if not (f > 0).any():
        return np.zeros(len(f))
    sizes = np.linalg.norm(A, axis=0)
    An, fn = A / sizes, f / sizes
    scale = max(size, float(np.abs(fn).max()))
    E, last = np.vstack([An, fn / scale]), np.append(np.zeros(len(A)), 1.0)
    u, _ = nnls(E, last)
    rest = 1.0 - float(fn / scale @ u)
    if not rest > RANK:
        if f.max() <= CONTRADICTION * (1 + size):  # what is left where everything stands still
            return np.zeros(len(f))
        raise StepError("impact", "what strikes at one instant cannot all give way")
    out = u > 0
    x = np.linalg.lstsq(An[:, out].T, fn[out], rcond=RANK)[0]  # to rounding, where those are the active ones
    tight = An.T @ x <= fn + SHARP * scale  # only those push that do not open faster
    p = np.zeros(len(f))
    p[tight], miss = nnls(An[:, tight], x)
    if miss > SHARP * size or (An.T @ x < fn - SHARP * scale).any():
        p = u / rest * scale
    return p / sizes
