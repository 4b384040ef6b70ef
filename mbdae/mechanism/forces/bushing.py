"""Bushings: linear springs and dampers in six directions between two frames."""

from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import model_validator

from ...errors import StepError
from ..key_units import Unit
from ..tree.frames import Pair, anchor, motion_cross, skew, wrench_matrix
from ..tree.manifold import inverse_jacobian
from ..tree.wrench_partials import COMPLEX_STEP, moved_line_partials, skews
from .force import Array, ArrayOrZero, CoreData, Force, ForceElement, FramePair, PairElement, WrenchPartials

MAX_ROTATION = 3.0  # rad: the rotation vector is smooth below pi

Six = tuple[float, float, float, float, float, float]


class Bushing(Force):
    """A compliant connection of two frames: stiffness and damping along the axes x, y, z, rx, ry, rz of the first.

    With the relative position p = R_a^T (p_b - p_a) and the rotation vector theta = log(R_a^T R_b), both (3,) in axes
    of the first frame, the potential is sum(k_i p_i^2)/2 + sum(k_i theta_i^2)/2. The dampers act on the relative
    velocity at the second frame's origin and on the relative angular velocity, in the same axes. The relative rotation
    must stay below 3 rad.

    Attributes:
        frames: names of both frames.
        stiffness: stiffnesses in N/m and N m/rad, (6,).
        damping: damping coefficients in N s/m and N m s/rad, (6,).
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["bushing"] = "bushing"
    frames: FramePair
    stiffness: Annotated[Six, Unit("N/m", "N/m", "N/m", "N m/rad", "N m/rad", "N m/rad")] = (0.0,) * 6
    damping: Annotated[Six, Unit("N s/m", "N s/m", "N s/m", "N m s/rad", "N m s/rad", "N m s/rad")] = (0.0,) * 6

    @model_validator(mode="after")
    def _check_damping(self) -> "Bushing":
        if min(self.damping) < 0:
            raise ValueError("the damping coefficients of a bushing must not be negative")
        return self

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        a, b = self.frames
        return BushingElement(self, Pair(model, data, anchor(model, a), anchor(model, b)))


class BushingElement(PairElement):
    """The law of `Bushing`.

    With theta' = J_l(theta)^-1 omega, omega the relative angular velocity in axes of the first frame, the potential
    yields the moment -J_l(theta)^-T K theta; J_l^-T = J_r^-1, the inverse right Jacobian of exp.
    """

    deflections = tuple((-1, axis) for axis in ("x", "y", "z", "rx", "ry", "rz"))

    def __init__(self, spec: Bushing, pair: Pair) -> None:
        super().__init__(spec.name)
        self.pair = pair
        self.k, self.kr = np.array(spec.stiffness).reshape(2, 3)
        self.d, self.dr = np.array(spec.damping).reshape(2, 3)
        self.damped = bool(self.d.any() or self.dr.any())

    def generalized_force(self, t: float, q: Array, v: Array) -> tuple[Array, ArrayOrZero]:
        """Return the generalized forces of springs and dampers.

        Raises:
            StepError: when the relative rotation reaches 3 rad.
        """
        p, theta = self.relative_pose()
        if np.sqrt(theta @ theta) > MAX_ROTATION:
            raise StepError("chart", f"bushing {self.name!r} rotates by more than {MAX_ROTATION} rad at t = {t:.17g}")
        spring = self._force_on_b(-self.k * p, -inverse_jacobian(skew(theta), self.kr * theta))
        if not self.damped:
            return spring, 0.0
        twist = self.pair.relative(v)
        velocity = (twist[:3] + skew(twist[3:]) @ self.pair.pb) @ self.pair.Ra
        return spring, self._force_on_b(-self.d * velocity, -self.dr * (twist[3:] @ self.pair.Ra))

    def wrench_partials(self, t: float, V: Array) -> tuple[WrenchPartials, WrenchPartials]:
        """See `PairElement`; Da follows from a common displacement d of both frames, which changes F by d x* F."""
        p, theta = self.relative_pose()
        Ra, pb, w = self.pair.Ra, self.pair.pb, V[3:]
        to_point = np.hstack([np.eye(3), -skew(pb)])  # V -> velocity of the point p_b
        J_left_inverse = np.array([inverse_jacobian(-skew(theta), e) for e in np.eye(3)]).T
        perturbed = theta + 1j * COMPLEX_STEP * np.eye(3)
        theta_partials = [
            inverse_jacobian(X, self.kr * x).imag / COMPLEX_STEP
            for X, x in zip(skews(perturbed.T), perturbed, strict=True)
        ]
        n, m = Ra @ (-self.k * p), Ra @ -inverse_jacobian(skew(theta), self.kr * theta)
        Db = moved_line_partials(pb, n[:, None])[0] - to_point.T @ (Ra * self.k) @ Ra.T @ to_point
        Db[3:, 3:] -= Ra @ np.array(theta_partials).T @ J_left_inverse @ Ra.T
        damper = (Ra * self.d) @ Ra.T
        u = -damper @ to_point @ V
        C = -to_point.T @ damper @ to_point
        C[3:, 3:] -= (Ra * self.dr) @ Ra.T
        Db_damper = moved_line_partials(pb, u[:, None])[0] - to_point.T @ damper @ skew(w) @ to_point
        spring = np.concatenate([n, m + skew(pb) @ n])
        damping = np.concatenate([u, skew(pb) @ u - (Ra * self.dr) @ Ra.T @ w])
        Da = wrench_matrix(damping) - Db_damper + C @ motion_cross(V[:, None], np.eye(6))
        zero = np.zeros((6, 6))
        return WrenchPartials(spring, wrench_matrix(spring) - Db, Db, zero), WrenchPartials(damping, Da, Db_damper, C)

    def deflection(self, q: Array) -> Array:
        return np.concatenate(self.relative_pose())

    def relative_pose(self) -> tuple[Array, Array]:
        """Return p and theta, (3,) each, in axes of the first frame."""
        self.pair.locate()
        Ra, Rb = self.pair.Ra, self.pair.Rb
        return (self.pair.pb - self.pair.pa) @ Ra, rotation_vector(Ra.T @ Rb)

    def _force_on_b(self, force: Array, moment: Array) -> Array:
        """Return the generalized force of a force and a moment at the origin of b, in axes of a."""
        n, m = self.pair.Ra @ force, self.pair.Ra @ moment
        return self.pair.generalized_force(np.concatenate([n, m + skew(self.pair.pb) @ n]))

    def potential(self, q: Array) -> float:
        p, theta = self.relative_pose()
        return 0.5 * float(self.k @ p**2 + self.kr @ theta**2)

    def core_data(self) -> CoreData:
        constants = [*self.k, *self.kr, *self.d, *self.dr, MAX_ROTATION]
        return {"kind": "bushing", "frames": self.pair, "a": constants}


def rotation_vector(R: Array) -> Array:
    """Return the rotation vector theta (3,) in rad of R = exp of the skew matrix of theta, accurate from 0 to 3 rad."""
    axis = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.sqrt(axis @ axis))
    angle = np.arctan2(sine, 0.5 * (np.trace(R) - 1))
    return axis * (angle / sine) if sine > 0 else axis
