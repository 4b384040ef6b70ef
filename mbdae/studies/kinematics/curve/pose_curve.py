"""The curve of closed configurations of a mechanism with one degree of freedom, by continuation in its arclength s.

    q' = tau, G tau = 0, |tau| = 1;   tau' = kappa, G kappa = -gamma(q, tau), kappa . tau = 0
    predictor q (+) (h tau + h^2/2 kappa);   corrector x = -G^+ g of minimum norm (Gauss-Newton), to rounding

Angles are in rad, lengths of rows and coordinates in characteristic lengths of the mechanism; the input u is in rad or
m. G has all rows except the driver's, redundant ones included; its pseudoinverse is truncated to rank nv - 1.
sigma, its smallest singular value, has the sign of det [B^T G; tau^T] with a basis B of range(G) that is continued
along the curve: sigma changes sign at branch points, and tau_in = e_in . tau at dead points of the input.

Source: Allgower, Georg, Introduction to Numerical Continuation Methods (2003), chapters 3, 7 and 8.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dgesdd
from scipy.optimize import brentq

from .... import tolerances as tol
from ....data_types import JsonObject
from ....errors import StepError
from ....system import Array

if TYPE_CHECKING:
    from ....mechanism.formulations.index2 import Index2System

MIN_COSINE = 0.9  # smallest cosine between tangents, and between left null spaces, at both ends of a step
ITERATIONS = 12
CONVERGED = tol.COINCIDENT  # size of a correction after which, by quadratic convergence, the next would be rounding
MAX_DISPLACEMENT = 100.0  # limit in rad or characteristic lengths for coordinates that are not periodic angles


class CurvePoint(NamedTuple):
    """A point of the curve.

    Attributes:
        s: arclength, in rad and characteristic lengths.
        q: configuration, (nq,).
        u: the input, in rad or m.
        tau: the tangent, (nv,), in rad and characteristic lengths.
        kappa: the curvature vector dtau/ds, (nv,).
        speed: tau_in = du/ds, in rad or m.
        input_curvature: d2u/ds2 = e_in . kappa + gamma_in.
        sigma: the smallest singular value of G, with a sign.
        left_null: orthonormal basis of the left null space of G, (ng - 1, k).
        orientation: +1, or -1 if ``left_null`` is reversed relative to its continuation from the start.
    """

    s: float
    q: Array
    u: float
    tau: Array
    kappa: Array
    speed: float
    input_curvature: float
    sigma: float
    left_null: Array
    orientation: float


@dataclass(frozen=True)
class BranchPoint:
    """A pose in which several branches intersect.

    Attributes:
        u: the input, in rad or m.
        q: configuration, (nq,).
        directions: tangents of the branches, (k, nv), of length 1 in rad and characteristic lengths; branches continue
            on both sides.
    """

    u: float
    q: Array
    directions: Array

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {"u": self.u, "q": self.q.tolist(), "directions": self.directions.tolist()}


class PoseCurve:
    """Solution curve of the closure equations.

    Args:
        system: a workspace of `mbdae.studies.kinematics.driven_mechanism.driven_mechanism`.
        angular: mask of the coordinates that are 2 pi-periodic angles, (nv,).
        period: period of the input: the curve is closed if the start pose recurs after a multiple of it; 0 if the input
            must return to its start value.

    Attributes:
        unit: scale of the input, in rad or m.
        scales: scale of each tangent component, in rad or m, (nv,).
        nodes: points in the order of the arclength.
        branch_points: branch points by the preceding node; None where more than two branches intersect, or location
            failed.
        ended: ``"range"``, ``"closed"`` (the start pose recurs), ``"failed"`` (the step size became too small), or
            ``"limit"`` (too many nodes, or too large a displacement).
    """

    def __init__(self, system: "Index2System", angular: Array, period: float = 0.0) -> None:
        self.system, self.angular, self.period = system, angular, period
        rows, self.scales = system.mechanism.row_scales, system.mechanism.coordinate_scales
        self.unit, self.row_scales = float(rows[-1]), np.append(rows[:-1], 1.0)
        self.r = system.nv - 1
        self.nodes: list[CurvePoint] = []
        self.branch_points: dict[int, BranchPoint | None] = {}
        self.ended = ""

    def closures(self, q: Array, u: float) -> tuple[Array, Array]:
        """Return g (ng,) and G (ng, nv) at the input u, lengths in characteristic lengths except in the last row."""
        g, G = self.system.closures(q, u)
        return g / self.row_scales, G * self.scales / self.row_scales[:, None]

    def integrate(self, q: Array, x: Array) -> Array:
        """Return q (+) x, (nq,)."""
        return self.system.manifold.integrate(q, self.scales * x)

    def difference(self, q0: Array, q1: Array) -> Array:
        """Return q1 (-) q0, (nv,)."""
        return self.system.manifold.difference(q0, q1) / self.scales

    def set_start(self, q: Array, u: float, along: Array | None = None) -> CurvePoint:
        """Set the first point from an approximate configuration, directed along a tangent or with increasing input.

        Raises:
            StepError: if no closed configuration is found.
        """
        if (found := self._correct(q, u)) is None:
            raise StepError("newton", f"the loops cannot be closed at {u:.6g}")
        q, u, (left, _, right), e = found
        tau = right[self.r]
        along_e = e @ tau if abs(e @ tau) > tol.SOLUTION_ROUNDING * self.unit else 1.0
        forward = tau @ along if along is not None else along_e
        tau = tau if forward > 0 else -tau
        first = CurvePoint(0.0, q, u, tau, tau, 0.0, 0.0, 1.0, left[:, self.r :], 1.0)
        self.nodes, self.branch_points = [self._point(found, first, 0.0)], {}
        return self.nodes[0]

    def step(self, p: CurvePoint, h: float) -> tuple[CurvePoint | None, float]:
        """Return the point a step h after p, None if it fails, and the error of the predictor."""
        predicted = self._predict(p, h)
        found = self._correct(predicted, p.u + h * p.speed)
        if found is None:
            return None, 0.0
        error = float(np.abs(self.difference(predicted, found[0])).max())
        if error > 0.2 * h or abs(found[2][2][self.r] @ p.tau) < MIN_COSINE:
            return None, error
        if p.left_null.shape[1] and abs(np.linalg.det(found[2][0][:, self.r :].T @ p.left_null)) < MIN_COSINE**2:
            return None, error
        new = self._point(found, p, p.s + h)
        return new._replace(s=p.s + self._length(p, new)), error

    def displacement(self) -> Array:
        """Return |q_last - q_first| of the coordinates that are not angles, (nv,), 0 for angles."""
        return np.abs(self.difference(self.nodes[0].q, self.nodes[-1].q)) * ~self.angular

    def is_full_period(self, change: float) -> bool:
        """Return whether a change of the input is zero or a multiple of its period."""
        remainder = change - self.period * round(change / self.period) if self.period else change
        return abs(remainder) < tol.SAME_POSE * self.unit

    def point_at_pose(self, i: int, pose: CurvePoint) -> CurvePoint | None:
        """Return the point between nodes i and i + 1 that has a given pose and direction; None if there is none."""
        a, b = self.nodes[i : i + 2]
        h, at, dx = b.s - a.s, a, self.wrapped_difference(a.q, pose.q)
        if not (np.abs(dx).max() < 2 * h and b.tau @ pose.tau > 0):
            return None
        for _ in range(4):  # the nearest point of the step: length along a tangent is not arclength
            along = at.s - a.s + float(dx @ at.tau)
            if not -tol.SAME_POSE <= along <= 1.5 * h:
                return None
            at = self.at(i, min(max(along, 0.0), h))
            dx = self.wrapped_difference(at.q, pose.q)
            if abs(dx @ at.tau) < tol.SAME_POSE:
                break
        if not (np.abs(dx).max() < tol.NEGLIGIBLE * h + tol.SAME_POSE and at.tau @ pose.tau > MIN_COSINE):
            return None
        found = self._correct(self.integrate(at.q, dx), at.u + float(dx @ at.tau) * at.speed)
        point = None if found is None else self._point(found, at, at.s + float(dx @ at.tau))
        return point if point and np.abs(self.wrapped_difference(point.q, pose.q)).max() < tol.SAME_POSE else None

    def wrapped_difference(self, q0: Array, q1: Array) -> Array:
        """Return q1 (-) q0 up to full turns of its angles, (nv,)."""
        x = self.difference(q0, q1)
        return np.where(self.angular, x - 2 * np.pi * np.round(x / (2 * np.pi)), x)

    def at(self, i: int, ds: float, *, predictor_only: bool = False) -> CurvePoint:
        """Return the point at arclength ds after node i, before node i + 1; without a corrector if ``predictor_only``.

        The predictor is a mean of those from both nodes, with cubic weights that cancel their third-order errors.

        Raises:
            StepError: if the corrector does not converge.
        """
        a, b = self.nodes[i], self.nodes[i + 1]
        h = b.s - a.s
        if ds in (0.0, h):
            return b if ds else a
        q0, q1 = (self._predict(p, x) for p, x in ((a, ds), (b, ds - h)))
        weight = ds**3 / (ds**3 + (h - ds) ** 3)
        u0, u1 = (p.u + x * (p.speed + 0.5 * x * p.input_curvature) for p, x in ((a, ds), (b, ds - h)))
        near, s = (a if ds < h / 2 else b), a.s + ds
        q, u = self.integrate(q0, weight * self.difference(q0, q1)), u0 + weight * (u1 - u0)
        if predictor_only:
            return near._replace(s=s, q=q, u=u)
        found = self._correct(q, u)
        if found is None:
            raise StepError("newton", f"the loops cannot be closed between {a.u:.9g} and {b.u:.9g}")
        return self._point(found, near, s)

    def arclength(self, i: int, p: CurvePoint) -> float:
        """Return the arclength of a point between nodes i and i + 1, a weighted mean of estimates from both nodes."""
        a, b = self.nodes[i : i + 2]
        after, before = self._length(a, p), self._length(p, b)
        return a.s + after + after**3 / (after**3 + before**3) * (b.s - before - a.s - after)

    def root(self, i: int, value: Callable[[CurvePoint], float]) -> float:
        """Return the arclength after node i of the root of a value that has opposite signs at nodes i and i + 1."""
        h = self.nodes[i + 1].s - self.nodes[i].s
        return float(brentq(lambda ds: value(self.at(i, ds)), 0.0, h, xtol=tol.ROUNDING, rtol=tol.SUM_ROUNDING))

    def at_input(self, p: CurvePoint, u: float) -> CurvePoint | None:
        """Return the point at the input u close to a point p, by [G; e_in] x = -[g; c - u]; None if it is not found."""
        found = self._correct(p.q, u, fixed_input=True)
        return None if found is None else self._point(found, p, p.s + (u - p.u) / (p.speed or 1.0))

    def _length(self, a: CurvePoint, b: CurvePoint) -> float:
        """Return the arclength from a to b.

        It solves q_b (-) q_a = s/2 (tau_a + tau_b) + s^2/12 (kappa_a - kappa_b) + O(s^5), and is limited to the chord
        and the chord over the smallest cosine of tangents, since curvatures are large next to branch points.
        """
        chord, mean = self.difference(a.q, b.q), 0.5 * (a.tau + b.tau)
        shortest = float(np.linalg.norm(chord))
        bending = (a.kappa - b.kappa) @ mean / 12
        s = (chord @ mean - shortest**2 * bending) / (mean @ mean)
        return float(np.clip(s, shortest, shortest / MIN_COSINE))

    def _predict(self, p: CurvePoint, h: float) -> Array:
        return self.integrate(p.q, h * (p.tau + 0.5 * h * p.kappa))

    def _correct(self, q: Array, u: float, *, fixed_input: bool = False) -> "Corrected | None":
        """Close the loops near q, at the input u or with minimum |x|; None on failure, or where G loses rank."""
        last = np.inf
        for _ in range(ITERATIONS):
            g, G = self.closures(q, u)
            left, sigmas, right = _svd(G[:-1])
            if self.r and not sigmas[self.r - 1] > tol.EPS * sigmas[0]:
                return None
            if last <= CONVERGED:
                return q, u if fixed_input else u + float(g[-1]), (left, sigmas, right), G[-1]
            x = -(left[:, : self.r].T @ g[:-1] / sigmas[: self.r]) @ right[: self.r]
            if fixed_input:
                tau = right[self.r]
                if not (speed := G[-1] @ tau):
                    return None
                x = x - tau * (g[-1] + G[-1] @ x) / speed
            size = float(np.abs(x).max())
            if not size < 1.0 or (size > last and last < tol.INTERPOLATION):
                return None
            q, last = self.integrate(q, x), size
        return None

    def _point(self, corrected: "Corrected", neighbour: CurvePoint, s: float) -> CurvePoint:
        """Return the point of a corrected pose at arclength s, oriented as a neighbour."""
        q, u, (left, sigmas, right), e = corrected
        r = self.r
        sign = 1.0 if right[r] @ neighbour.tau > 0 else -1.0
        tau, null = sign * right[r], left[:, r:]
        gamma = self.system.gamma(q, self.scales * tau, u) / self.row_scales
        kappa = -(left[:, :r].T @ gamma[:-1] / sigmas[:r]) @ right[:r] if r else np.zeros(1)
        reversal = np.sign(np.linalg.det(null.T @ neighbour.left_null)) if null.shape[1] else 1.0
        orientation = neighbour.orientation * reversal
        det_sign = sign * orientation * np.sign(np.linalg.det(right) * np.linalg.det(left))
        sigma = float(sigmas[r - 1] * det_sign) if r else 1.0
        return CurvePoint(s, q, u, tau, kappa, float(e @ tau), float(e @ kappa + gamma[-1]), sigma, null, orientation)


Corrected = tuple[Array, float, tuple[Array, Array, Array], Array]


def _svd(G: Array) -> tuple[Array, Array, Array]:
    if not len(G):
        return np.eye(0), np.zeros(0), np.eye(G.shape[1])
    left, sigmas, right, _ = dgesdd(G)
    return left, sigmas, right
