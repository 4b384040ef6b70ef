"""Configuration manifold and its tangent map: x' = J(x) v in coordinates q = q_n (+) x of a step.

J(x) is the inverse right Jacobian of exp, one block for each spherical, planar and free-flying joint and the identity
elsewhere, computed from its series (Iserles, Munthe-Kaas, Noersett, Zanna, Acta Numerica 2000, (B.11)),

    J(x) v = v + [x, v]/2 + sum_k B_2k/(2k)! ad_x^2k v,      exp'(x) x' = sum_k (-1)^k/(k + 1)! ad_x^k x',

because Pinocchio's closed forms lose digits at small angles. For the same reason, this module integrates and subtracts
configurations of planar joints: (1 - cos w)/w of a rotation w has an error of eps/w. A body that moves along an arc u
and rotates by w moves along the chord R(w/2) u sin(w/2)/(w/2). Pinocchio also misses rotations below 1.5e-8 between
two points (cos, sin) of a circle: it treats them as equal if rounding gives a cosine above 1.
"""

from collections.abc import Callable
from fractions import Fraction
from math import atan2, cos, sin

import numpy as np
import pinocchio as pin

from ...errors import StepError
from ...tolerances import BELOW_ROUNDING, ROUNDING
from .frames import skew

TERMS = 40
MAX_ROTATION = 3.0  # rad within one step: below pi, so that the ends of a step determine the rotation


def _series() -> list[float]:
    """Return b_k = B_2k/(2k)! for k = 1, 2, ..., by Euler's (2k + 1) b_k = -(b_1 b_k-1 + ... + b_k-1 b_1)."""
    b = [Fraction(1, 12)]
    for k in range(2, TERMS):
        b.append(sum((x * y for x, y in zip(b, reversed(b), strict=True)), Fraction(0)) / -(2 * k + 1))
    return [float(x) for x in b]


SERIES = _series()
AdjointOperator = Callable[[np.ndarray], np.ndarray]  # x -> ad_x, the matrix of the Lie bracket [x, .]


def _so3(x: np.ndarray) -> np.ndarray:
    return skew(x)


def _se3(x: np.ndarray) -> np.ndarray:
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = skew(x[3:])
    out[:3, 3:] = skew(x[:3])
    return out


def _se2(x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [0.0, 0.0, 0.0]])


GROUPS: dict[AdjointOperator, str] = {_so3: "so3", _se3: "se3", _se2: "se2"}
# ad_x, and the slice of the rotation in the tangent, by joint
GROUP_JOINTS: dict[str, tuple[AdjointOperator, slice]] = {
    "JointModelSpherical": (_so3, slice(0, 3)),
    "JointModelFreeFlyer": (_se3, slice(3, 6)),
    "JointModelPlanar": (_se2, slice(2, 3)),
}


class Manifold:
    """Configuration manifold of a model; ``flat`` if it is a vector space."""

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        self.flat = model.nq == model.nv
        self.group_joints: list[tuple[str, slice, AdjointOperator, slice]] = []
        self.group_starts: list[int] = []  # first index of each block in q
        self.circles: list[int] = []  # tangent indices of unbounded revolute joints
        self.angles: list[tuple[int, int]] = []  # tangent indices of angles, indices of their cosines and sines in q
        self.unit_blocks: list[slice] = []  # components of q that form unit vectors: quaternions, cosines and sines
        self.angular = np.zeros(model.nv, bool)  # tangent components that are angles of unlimited range
        for name, joint in zip(model.names[1:], list(model.joints)[1:], strict=True):
            self._collect(name, joint, joint.idx_v, joint.idx_q)
        self.planar = [
            (k, s) for (_, s, ad, _), k in zip(self.group_joints, self.group_starts, strict=True) if ad is _se2
        ]

    def _collect(self, name: str, joint: pin.JointModel, idx_v: int, idx_q: int) -> None:
        kind = joint.shortname()
        if kind == "JointModelComposite":
            for factor in joint.extract().joints:
                self._collect(name, factor, idx_v, idx_q)
                idx_v, idx_q = idx_v + factor.nv, idx_q + factor.nq
        elif kind in GROUP_JOINTS:
            ad, rotation = GROUP_JOINTS[kind]
            self.group_joints.append((name, slice(idx_v, idx_v + joint.nv), ad, rotation))
            self.group_starts.append(idx_q)
            self.angular[idx_v : idx_v + joint.nv][rotation] = True
            start = idx_q + joint.nv - (rotation.stop - rotation.start)  # first component of the rotation
            self.unit_blocks.append(slice(start, idx_q + joint.nq))
            if ad is _se2:
                self.angles.append((idx_v + 2, idx_q + 2))
        elif joint.nq != joint.nv:  # unbounded revolute: commutative, J = 1
            self.angular[idx_v : idx_v + joint.nv] = True
            self.circles.append(idx_v)
            self.unit_blocks.append(slice(idx_q, idx_q + 2))
            self.angles.append((idx_v, idx_q))

    def integrate(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return q (+) x, (nq,)."""
        if self.flat:
            return q + x
        out = pin.integrate(self.model, q, x)
        for k, s in self.planar:
            C, ratio = chord(q[k + 2 : k + 4], x[s.stop - 1])
            out[k : k + 2] = q[k : k + 2] + ratio * C.dot(x[s][:2])
        return out

    def difference(self, q0: np.ndarray, q1: np.ndarray) -> np.ndarray:
        """Return q1 (-) q0 in the tangent at q0, (nv,)."""
        if self.flat:
            return q1 - q0
        x = pin.difference(self.model, q0, q1)
        for i, k in self.angles:
            c, s, c1, s1 = q0[k], q0[k + 1], q1[k], q1[k + 1]
            x[i] = atan2(c * s1 - s * c1, c * c1 + s * s1)
        for k, s in self.planar:
            C, ratio = chord(q0[k + 2 : k + 4], x[s.stop - 1])
            x[s.start : s.start + 2] = C.T.dot(q1[k : k + 2] - q0[k : k + 2]) / ratio
        return x

    def unwrapped(self, q0: np.ndarray, q1: np.ndarray, estimate: np.ndarray) -> np.ndarray:
        """Return q1 (-) q0, (nv,), with angles of unbounded revolute joints unwrapped to the closest to an estimate."""
        x = self.difference(q0, q1)
        if self.circles:
            x[self.circles] += 2 * np.pi * np.round((estimate - x)[self.circles] / (2 * np.pi))
        return x

    def is_same_point(self, q0: np.ndarray, q1: np.ndarray, scales: np.ndarray) -> bool:
        """Return whether two configurations, divided by scales (nq,), are equal up to rounding; nan is never equal."""
        return bool(np.abs((q0 - q1) / scales).max() <= ROUNDING * (1 + np.abs(q0 / scales).max()))

    def require_small_rotations(self, x: np.ndarray) -> None:
        """Reject coordinates of a step in which a joint rotates too far.

        Raises:
            StepError: if a spherical, planar or free joint rotates by more than 3 rad in one step.
        """
        for name, s, _, rotation in self.group_joints:
            angles = x[s][rotation]
            if angles.dot(angles) > MAX_ROTATION**2:
                raise StepError("chart", f"joint {name!r} rotates by more than {MAX_ROTATION} rad in one step")

    def component_magnitudes(self, q: np.ndarray) -> np.ndarray:
        """Return magnitudes of tangent components, (nv,): |q| for lengths and bounded angles, 1 for rotations."""
        if self.flat:
            return np.abs(q)
        return np.where(self.angular, 1.0, np.abs(self.difference(pin.neutral(self.model), q)))

    def tangent(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return x' = J(x) v, (nv,).

        Raises:
            StepError: see `require_small_rotations`.
        """
        if not self.group_joints:
            return v
        self.require_small_rotations(x)
        out = v.copy()
        for _, s, ad, _ in self.group_joints:
            out[s] = inverse_jacobian(ad(x[s]), v[s])
        return out

    def tangent_rate(self, x: np.ndarray, dx: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return d/ds J(x + s dx) v at s = 0, (nv,), term by term from the series."""
        out = np.zeros_like(v)
        for _, s, ad, _ in self.group_joints:
            if not dx[s].any():
                continue
            X, dX, term = ad(x[s]), ad(dx[s]), v[s]
            square, dsquare, dterm = X.dot(X), dX.dot(X) + X.dot(dX), np.zeros_like(term)
            rate, small = 0.5 * dX.dot(term), BELOW_ROUNDING * np.abs(term).max()
            for b in SERIES:
                term, dterm = square.dot(term), dsquare.dot(term) + square.dot(dterm)
                rate += b * dterm
                if max(np.abs(term).max(), np.abs(dterm).max()) * abs(b) <= small:
                    break
            out[s] = rate
        return out

    def coordinate_partials(self, q: np.ndarray) -> np.ndarray:
        """Return the partial derivatives of the components of q (+) x with respect to x at x = 0, (nq, nv)."""
        if self.flat:
            return np.eye(self.model.nv)
        return pin.tangentMap(self.model, q).reshape(self.model.nq, self.model.nv)  # with nv = 1 it is a vector

    def normalized(self, q: np.ndarray) -> np.ndarray:
        """Return the configuration of raw coordinates q, (nq,), with unit vectors normalized."""
        return q if self.flat else pin.normalize(self.model, q)

    def velocity(self, x: np.ndarray, dx: np.ndarray) -> np.ndarray:
        """Return v = J(x)^-1 x', (nv,)."""
        if not self.group_joints:
            return dx
        out = dx.copy()
        for _, s, ad, _ in self.group_joints:
            X, term = ad(x[s]), dx[s]
            for k in range(1, 2 * TERMS):
                term = -(X @ term) / (k + 1)
                out[s] += term
                if np.abs(term).max() <= BELOW_ROUNDING * np.abs(out[s]).max():
                    break
        return out


def chord(heading: np.ndarray, angle: float) -> tuple[np.ndarray, float]:
    """Return the orientation (2, 2) of a planar joint halfway through a rotation, and the ratio of chord to arc.

    Args:
        heading: cosine and sine of its angle before the rotation, (2,).
        angle: angle of the rotation in rad.
    """
    half = angle / 2
    c, s = cos(half), sin(half)
    c, s = heading[0] * c - heading[1] * s, heading[1] * c + heading[0] * s
    return np.array([[c, -s], [s, c]]), sin(half) / half if half else 1.0


def inverse_jacobian(X: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return J v = v + X v/2 + sum_k B_2k/(2k)! X^2k v, the inverse right Jacobian of exp for X = ad_x."""
    out = v + 0.5 * X.dot(v)
    term, square, small = v, X.dot(X), BELOW_ROUNDING * np.abs(v).max()
    for b in SERIES:
        term = square.dot(term)
        out += b * term
        if np.abs(term).max() * abs(b) <= small:
            break
    return out
