"""Branch points of the curve: where closures lose rank, and curves cross.

At a simple one G has two null vectors N (nv, 2) and one left null vector u that its neighbours have not. Along a
branch y' N with tangent N y the closures stay closed to second order where y^T N^T K_u N y = 0, K_u = d(G^T u)/dq.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import null_space

from ...errors import StepError
from ...system import Array
from ...tolerances import AGREEMENT, EVALUATION_ROUNDING, RANK, SOLUTION_ROUNDING, VISIBLE

if TYPE_CHECKING:
    from .pose_curve import CurvePoint, PoseCurve

POLISH = 6  # Newton steps onto a branch point
LONGEST = 0.05  # how far it may lie from where the sign changes


@dataclass(frozen=True)
class BranchPoint:
    """A pose from which several branches lead.

    Attributes:
        u: the input, in rad or m.
        q: configuration, (nq,).
        directions: tangents of the branches, (k, nv); each may be left to both sides. They are of length 1, measured in
            rad and characteristic lengths.
    """

    u: float
    q: Array
    directions: Array

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {"u": self.u, "q": self.q.tolist(), "directions": self.directions.tolist()}


def branch_point(curve: "PoseCurve", i: int) -> BranchPoint | None:
    """The branch point behind node i, where sigma changes its sign; None where it is not a simple one.

    The sign tells where; then Newton's method on 0 = N^T G^T u and the rows of g that G has the rank for there. The row
    u^T g that is left is the gap at which branches pass each other.

    Raises:
        StepError: where they do not meet, or nothing is found: the step led from one branch to another.
    """
    h = curve.nodes[i + 1].s - curve.nodes[i].s
    at = _nearest(curve, i, h)
    q, u, r = at.q, at.u, curve.r
    for _ in range(POLISH):
        g, G = curve.closures(q, u)
        left, sizes, right = np.linalg.svd(G[:-1])
        if r > 1 and sizes[r - 2] < VISIBLE * sizes[0]:
            return None
        N, new = right[r - 1 :].T, _new_null(left[:, r - 1 :], curve.nodes[i].left)
        K = curve.bending(np.append(new, 0.0))
        rows = np.vstack([right[: r - 1], N.T @ K])
        rest = np.concatenate([left[:, : r - 1].T @ g[:-1] / sizes[: r - 1], N.T @ (G[:-1].T @ new)])
        x = -np.linalg.lstsq(rows, rest, rcond=AGREEMENT)[0]
        q, u = curve.integrate(q, x), u + float(g[-1] + G[-1] @ x)
        if np.abs(x).max() < EVALUATION_ROUNDING:
            break
    if np.abs(curve.difference(at.q, q)).max() > LONGEST or abs(new @ g[:-1]) > AGREEMENT:
        raise StepError("newton", f"two branches pass each other near {u:.9g}")
    if abs(sizes[r - 1]) > RANK * sizes[0]:
        return None
    a, b, c = (form := N.T @ (K + K.T) @ N / 2)[0, 0], form[0, 1], form[1, 1]
    if not b * b - a * c > SOLUTION_ROUNDING * np.abs(form).max() ** 2:
        return None
    values, vectors = np.linalg.eigh(form)  # of one sign each: y = sqrt(-w_0) e_1 +- sqrt(w_1) e_0
    first, second = np.sqrt(values[1]) * vectors[:, 0], np.sqrt(-values[0]) * vectors[:, 1]
    ways = np.array([N @ (first + second), N @ (first - second)])
    return BranchPoint(u, q, ways / np.linalg.norm(ways, axis=1)[:, None])


def _nearest(curve: "PoseCurve", i: int, h: float) -> "CurvePoint":
    """The point of a step where sigma is about zero: regula falsi while loops can be closed, then in between."""
    low, high, at = 0.0, h, curve.nodes[i]
    a, b = curve.nodes[i].sigma, curve.nodes[i + 1].sigma
    for _ in range(8):
        sigma = low + (high - low) * a / (a - b)
        try:
            at = curve.at(i, sigma)
        except (StepError, np.linalg.LinAlgError, ValueError):
            break
        if abs(at.sigma) < VISIBLE:
            break
        low, high, a, b = (sigma, high, at.sigma, b) if at.sigma * a > 0 else (low, sigma, a, at.sigma)
    return at


def _new_null(null: Array, before: Array) -> Array:
    """The left null vector that is not among those before: (n,) of ``null`` (n, k + 1) and ``before`` (n, k)."""
    return null @ null_space(before.T @ null, rcond=0.5)[:, 0] if before.shape[1] else null[:, 0]
