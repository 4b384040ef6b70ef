"""Branch points of the curve: configurations in which the closures lose rank and curves intersect.

At a simple branch point G has two null vectors N (nv, 2), and one left null vector w that neighbouring points do not
have. A vector N y is tangent to a branch if y^T N^T K_w N y = 0 with K_w = d(G^T w)/dq.
"""

import numpy as np
from scipy.linalg import null_space

from ....errors import StepError
from ....system import Array
from ....tolerances import AGREEMENT, EVALUATION_ROUNDING, RANK, SOLUTION_ROUNDING, VISIBLE
from ..driven_mechanism import constraint_hessian
from .pose_curve import BranchPoint, CurvePoint, PoseCurve

NEWTON_STEPS = 6  # maximum number of Newton iterations
MAX_DISTANCE = 0.05  # distance of a branch point from the sign change of sigma, in rad or characteristic lengths


def branch_point(curve: PoseCurve, i: int) -> BranchPoint | None:
    """Return the branch point after node i, where sigma changes sign; None if it is not simple.

    The sign change is the start of Newton's method for 0 = N^T G^T w and the rows of g within the range of G. The
    remaining w^T g is the distance of branches that do not intersect.

    Raises:
        StepError: if branches do not intersect, or no point is found: the step jumped from one branch to another.
    """
    h = curve.nodes[i + 1].s - curve.nodes[i].s
    at = _sign_change(curve, i, h)
    q, u, r = at.q, at.u, curve.r
    for _ in range(NEWTON_STEPS):
        g, G = curve.closures(q, u)
        left, sigmas, right = np.linalg.svd(G[:-1])
        if r > 1 and sigmas[r - 2] < VISIBLE * sigmas[0]:
            return None
        N, left_null = right[r - 1 :].T, _additional_null_vector(left[:, r - 1 :], curve.nodes[i].left_null)
        K = constraint_hessian(curve.system, left_null)
        rows = np.vstack([right[: r - 1], N.T @ K])
        residual = np.concatenate([left[:, : r - 1].T @ g[:-1] / sigmas[: r - 1], N.T @ (G[:-1].T @ left_null)])
        x = -np.linalg.lstsq(rows, residual, rcond=AGREEMENT)[0]
        q, u = curve.integrate(q, x), u + float(g[-1] + G[-1] @ x)
        if np.abs(x).max() < EVALUATION_ROUNDING:
            break
    if np.abs(curve.difference(at.q, q)).max() > MAX_DISTANCE or abs(left_null @ g[:-1]) > AGREEMENT:
        raise StepError("newton", f"two branches come close without intersecting near {u:.9g}")
    if abs(sigmas[r - 1]) > RANK * sigmas[0]:
        return None
    a, b, c = (form := N.T @ (K + K.T) @ N / 2)[0, 0], form[0, 1], form[1, 1]
    if not b * b - a * c > SOLUTION_ROUNDING * np.abs(form).max() ** 2:
        return None
    values, vectors = np.linalg.eigh(form)  # eigenvalues mu of opposite signs: y = sqrt(-mu_0) e_1 +- sqrt(mu_1) e_0
    first, second = np.sqrt(values[1]) * vectors[:, 0], np.sqrt(-values[0]) * vectors[:, 1]
    tangents = np.array([N @ (first + second), N @ (first - second)])
    return BranchPoint(u, q, tangents / np.linalg.norm(tangents, axis=1)[:, None])


def _sign_change(curve: PoseCurve, i: int, h: float) -> CurvePoint:
    """Return the point of a step where sigma is nearly zero, by regula falsi as long as loops can be closed."""
    low, high, at = 0.0, h, curve.nodes[i]
    a, b = curve.nodes[i].sigma, curve.nodes[i + 1].sigma
    for _ in range(8):
        ds = low + (high - low) * a / (a - b)
        try:
            at = curve.at(i, ds)
        except (StepError, np.linalg.LinAlgError, ValueError):
            break
        if abs(at.sigma) < VISIBLE:
            break
        low, high, a, b = (ds, high, at.sigma, b) if at.sigma * a > 0 else (low, ds, a, at.sigma)
    return at


def _additional_null_vector(null: Array, before: Array) -> Array:
    """Return the vector (n,) in the span of ``null`` (n, k + 1) that is orthogonal to ``before`` (n, k)."""
    return null @ null_space(before.T @ null, rcond=0.5)[:, 0] if before.shape[1] else null[:, 0]
