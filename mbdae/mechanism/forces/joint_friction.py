"""Coulomb friction in joints, regularised."""

from typing import Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from ...errors import InputError
from ..frames import find_joints, joint_names
from .force import Array, Force, ForceElement, Joints


class JointFriction(Force):
    """Regularised Coulomb friction, tau = -friction * tanh(v / velocity) on each coordinate of the joints.

    Attributes:
        joint: one joint or several; all joints when left out.
        friction: N m or N; the values of the URDF's ``<dynamics friction>``, one for each coordinate, when left out.
        velocity: where the friction has reached three quarters of its value, in rad/s or m/s; not too small: the
            problem's time constant is inertia * velocity / friction.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Literal["joint_friction"] = "joint_friction"
    joint: Joints = ()
    friction: float | None = Field(default=None, ge=0)
    velocity: float = Field(default=0.01, gt=0)

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:  # noqa: D102
        d, given = np.zeros(model.nv), np.array(model.upperDryFrictionLimit)
        for j in find_joints(model, self.joint or joint_names(model)):
            at = slice(j.idx_v, j.idx_v + j.nv)
            d[at] = given[at] if self.friction is None else self.friction
        if not d.any() and self.friction is None:
            raise InputError(f"the URDF gives no friction for force {self.name!r}: say friction = ...")
        return FrictionElement(self.name, d, self.velocity)


class FrictionElement(ForceElement):
    """tau = -d * tanh(v / v0) with d (nv,)."""

    def __init__(self, name: str, d: Array, v0: float) -> None:
        super().__init__(name)
        self.d, self.v0 = d, v0

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        return 0.0, -self.d * np.tanh(v / self.v0)

    def slopes(self, t: float, q: Array, v: Array, s: Array) -> Array:  # noqa: D102
        nv, (_, tau) = len(v), self.torque(t, q, v)
        out, steep = np.zeros((nv + 1, 2 * nv)), self.d / self.v0 * (np.tanh(v / self.v0) ** 2 - 1)
        out[:nv, nv:], out[-1, nv:] = np.diag(steep), steep * v + tau
        return out

    def plain(self) -> dict[str, Any]:  # noqa: D102
        return {"kind": "friction", "a": [*self.d.tolist(), self.v0]}
