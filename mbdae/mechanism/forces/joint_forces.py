"""Forces on joints: springs, dampers, friction, and torques that follow a function of time."""

from functools import cached_property
from typing import Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, field_validator, model_validator
from scipy.interpolate import PPoly

from ...errors import InputError
from ..frames import find_joint, find_joints, joint_names
from ..signals import Interpolation, Point, Signal, curve, increasing
from .law import Array, Force, Law

Joints = str | tuple[str, ...]


class JointDamping(Force):
    """tau = -damping * v on each coordinate of the joints; replaces their URDF damping.

    Attributes:
        joint: one joint or several.
        damping: N m s/rad or N s/m.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Literal["joint_damping"] = "joint_damping"
    joint: Joints
    damping: float = Field(ge=0)

    def bind(self, model: pin.Model, data: pin.Data) -> Law:  # noqa: D102
        d = np.zeros(model.nv)
        for j in find_joints(model, self.joint):
            d[j.idx_v : j.idx_v + j.nv] = self.damping
        return DampingLaw(self.name, d)


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

    def bind(self, model: pin.Model, data: pin.Data) -> Law:  # noqa: D102
        d, given = np.zeros(model.nv), np.array(model.upperDryFrictionLimit)
        for j in find_joints(model, self.joint or joint_names(model)):
            at = slice(j.idx_v, j.idx_v + j.nv)
            d[at] = given[at] if self.friction is None else self.friction
        if not d.any() and self.friction is None:
            raise InputError(f"the URDF gives no friction for force {self.name!r}: say friction = ...")
        return FrictionLaw(self.name, d, self.velocity)


class JointSpring(Force):
    """A spring and damper on joints of one coordinate: tau = -c(q - rest) - damping * v.

    Attributes:
        joint: one joint or several.
        stiffness: c(x) = stiffness * x, in N m/rad or N/m.
        table: points (deflection, restoring torque) of a nonlinear c instead, deflections increasing; straight on
            beyond its ends. The potential is the exact integral.
        interpolation: of the table: ``"spline"`` (natural cubic) or ``"monotone"`` (cubic without overshoot).
        rest: rad or m.
        damping: N m s/rad or N s/m, besides the joint's own.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Literal["joint_spring"] = "joint_spring"
    joint: Joints
    stiffness: float | None = None
    table: tuple[Point, ...] | None = Field(default=None, min_length=2)
    interpolation: Interpolation = "spline"
    rest: float = 0.0
    damping: float = Field(default=0.0, ge=0)

    @field_validator("table")
    @classmethod
    def _rise(cls, table: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        return increasing(table) if table else None

    @model_validator(mode="after")
    def _one_law(self) -> "JointSpring":
        if (self.stiffness is None) == (self.table is None):
            raise ValueError("a joint_spring takes a stiffness or a table")
        _ = self.table and self.curve
        return self

    @cached_property
    def curve(self) -> PPoly:
        """The table's restoring torque as a function of the deflection."""
        return curve(self.table or (), self.interpolation, held=False)

    def bind(self, model: pin.Model, data: pin.Data) -> Law:  # noqa: D102
        joints = single(model, self.joint, "a joint spring")
        if self.stiffness is not None:
            return SpringLaw(self.name, model.nv, joints, self.stiffness, self.rest, self.damping)
        return CurveLaw(self.name, model.nv, joints, self.curve, self.rest, self.damping)


class JointTorque(Force):
    """A torque (N m) or force (N) on a joint: constants or functions of time, one for each of its nv coordinates.

    Attributes:
        joint: one joint.
        torque: one number or function, or nv of them.
        gear: a factor on all of them.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Literal["joint_torque"] = "joint_torque"
    joint: str
    torque: Signal | tuple[Signal, ...]
    gear: float = 1.0

    def bind(self, model: pin.Model, data: pin.Data) -> Law:  # noqa: D102
        j = find_joint(model, self.joint)
        values = self.torque if isinstance(self.torque, tuple) else (self.torque,)
        if len(values) != j.nv:
            raise InputError(f"joint {self.joint!r} takes {j.nv} torque values, got {len(values)}")
        return JointTorqueLaw(self.name, model.nv, j.idx_v, values, self.gear)


class DampingLaw(Law):
    """tau = -d * v with d (nv,)."""

    def __init__(self, name: str, d: Array) -> None:
        super().__init__(name)
        self.d = d

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        return 0.0, -self.d * v


class FrictionLaw(Law):
    """tau = -d * tanh(v / v0) with d (nv,)."""

    def __init__(self, name: str, d: Array, v0: float) -> None:
        super().__init__(name)
        self.d, self.v0 = d, v0

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        return 0.0, -self.d * np.tanh(v / self.v0)


class _SpringLaw(Law):
    """tau = -c(q - rest) - d v on single coordinates."""

    def __init__(self, name: str, nv: int, joints: list[pin.JointModel], rest: float, damping: float) -> None:
        super().__init__(name)
        self.rest, self.nv, self.damping = rest, nv, damping
        self.iq, self.iv = [j.idx_q for j in joints], [j.idx_v for j in joints]

    def torque(self, t: float, q: Array, v: Array) -> tuple[Array, Array | float]:
        spring = np.zeros(self.nv)
        spring[self.iv] = -self.restoring(q[self.iq] - self.rest)
        if not self.damping:
            return spring, 0.0
        damper = np.zeros(self.nv)
        damper[self.iv] = -self.damping * v[self.iv]
        return spring, damper

    def restoring(self, x: Array) -> Array:
        """Return c(x) of deflections x (n,)."""
        raise NotImplementedError


class SpringLaw(_SpringLaw):
    """tau = -k (q - rest) - d v on single coordinates."""

    def __init__(
        self, name: str, nv: int, joints: list[pin.JointModel], k: float, rest: float, damping: float = 0.0
    ) -> None:
        super().__init__(name, nv, joints, rest, damping)
        self.k = k

    def restoring(self, x: Array) -> Array:  # noqa: D102
        return self.k * x

    def potential(self, q: Array) -> float:  # noqa: D102
        return 0.5 * self.k * float(((q[self.iq] - self.rest) ** 2).sum())


class CurveLaw(_SpringLaw):
    """tau = -c(q - rest) - d v on single coordinates, c a piecewise polynomial."""

    def __init__(
        self, name: str, nv: int, joints: list[pin.JointModel], c: PPoly, rest: float, damping: float
    ) -> None:
        super().__init__(name, nv, joints, rest, damping)
        self.c, self.integral = c, c.antiderivative()

    def restoring(self, x: Array) -> Array:  # noqa: D102
        return self.c(x)

    def potential(self, q: Array) -> float:
        """Return the integral of c from 0 to the deflection, over all coordinates, in J."""
        return float((self.integral(q[self.iq] - self.rest) - self.integral(0.0)).sum())


class JointTorqueLaw(Law):
    """tau = gear * signals(t) on consecutive coordinates from ``at`` on."""

    def __init__(self, name: str, nv: int, at: int, values: tuple[Signal, ...], gear: float = 1.0) -> None:
        super().__init__(name, values)
        self.values, self.part, self.tau, self.gear = values, slice(at, at + len(values)), np.zeros(nv), gear
        if not self.signals:
            self.tau[self.part] = [gear * s.at(0.0) for s in values]

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        if not self.signals:
            return 0.0, self.tau
        tau = np.zeros_like(self.tau)
        tau[self.part] = [self.gear * s.at(t) for s in self.values]
        return 0.0, tau


def single(model: pin.Model, names: Joints, what: str) -> list[pin.JointModel]:
    """Return joints of one coordinate.

    Raises:
        InputError: for other joints.
    """
    joints = find_joints(model, names)
    for j, n in zip(joints, [names] if isinstance(names, str) else names, strict=True):
        if (j.nq, j.nv) != (1, 1):
            raise InputError(f"{what} needs a joint of one coordinate; {n!r} has nq = {j.nq}, nv = {j.nv}")
    return joints
