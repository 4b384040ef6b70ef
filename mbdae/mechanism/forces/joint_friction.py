"""Coulomb friction in joints, regularised or exact."""

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ...errors import InputError
from ..frames import find_joints, joint_names
from .force import Array, Force, ForceElement, Joints
from .joint_law import Effort, JointElement

VELOCITY = 0.01  # rad/s or m/s


class HeldJoint(NamedTuple):
    """A joint with exact dry friction.

    Attributes:
        joint: its name.
        force: name of the friction.
        kinetic: friction while it slips, in N m or N.
        static: largest friction while it sticks.
    """

    joint: str
    force: str
    kinetic: float
    static: float


class JointFriction(Force):
    """Coulomb friction on each coordinate of the joints, regularised or exact.

    Regularised: tau = -friction * tanh(v / velocity). A loaded joint then creeps, and the problem is stiff.

    Exact, where ``static`` is given or ``exact`` is true: a joint slips, tau = -friction * sign(v), or sticks, v = 0,
    as long as that takes no more than ``static``. A run locates these transitions, see `mbdae.mechanism.hybrid`;
    outside of runs there is no friction.

    Attributes:
        joint: one joint or several; all joints when left out.
        friction: N m or N; the values of the source, URDF ``<dynamics friction>`` and MJCF ``frictionloss``, one for
            each coordinate, when left out.
        velocity: where regularised friction reaches three quarters of its value, in rad/s or m/s; not too small: the
            problem's time constant is inertia * velocity / friction. 0.01 when left out.
        static: largest friction of a sticking joint, in N m or N, at least ``friction``, which is the default.
        exact: the joint can stick; true where ``static`` is given.
        name: for parameters, signals and messages; the kind and a number when left out.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["joint_friction"] = "joint_friction"
    joint: Joints = ()
    friction: float | None = Field(default=None, ge=0)
    velocity: float | None = Field(default=None, gt=0)
    static: float | None = Field(default=None, ge=0)
    exact: bool = False

    @model_validator(mode="after")
    def _fits(self) -> "JointFriction":
        if self.sticks and self.velocity is not None:
            raise ValueError("velocity belongs to regularised friction, not to static or exact")
        if self.static is not None and self.static < (self.friction or 0.0):
            raise ValueError(f"static is at least friction, {self.friction:g}, got {self.static:g}")
        return self

    @property
    def sticks(self) -> bool:
        """Whether it is exact."""
        return self.exact or self.static is not None

    def holds(self, model: pin.Model) -> Iterator[HeldJoint]:
        """Yield the joints that can stick; none for regularised friction.

        Raises:
            InputError: for a joint of several coordinates, or less static friction than the source's.
        """
        if not self.sticks:
            return
        given, names = self._given(model), [self.joint] if isinstance(self.joint, str) else self.joint
        for name in names or joint_names(model):
            (j,) = find_joints(model, name)
            if self.joint and j.nv != 1:
                raise InputError(f"friction that sticks needs a joint with one velocity; {name!r} has {j.nv}")
            kinetic = float(given[j.idx_v : j.idx_v + j.nv].max(initial=0.0))
            static = kinetic if self.static is None else self.static
            if kinetic > static:
                raise InputError(f"force {self.name!r}: static is at least the {kinetic:g} of joint {name!r}")
            if j.nv == 1 and static:
                yield HeldJoint(name, self.name, kinetic, static)
            elif kinetic:
                raise InputError(f"friction that sticks needs a joint with one velocity; {name!r} has {j.nv}")

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        d = self._given(model)
        if not d.any() and self.friction is None:
            raise InputError(f"the URDF gives no friction for force {self.name!r}: say friction = ...")
        return (
            KineticFrictionElement(self.name, d)
            if self.sticks
            else FrictionElement(self.name, d, self.velocity or VELOCITY)
        )

    def _given(self, model: pin.Model) -> Array:
        d, given = np.zeros(model.nv), np.array(model.upperDryFrictionLimit)
        for j in find_joints(model, self.joint or joint_names(model)):
            at = slice(j.idx_v, j.idx_v + j.nv)
            d[at] = given[at] if self.friction is None else self.friction
        return d


class FrictionElement(JointElement):
    """tau = -d * tanh(v / v0) with d (nv,)."""

    def __init__(self, name: str, d: Array, v0: float) -> None:
        super().__init__(name, range(len(d)))
        self.d, self.v0 = d, v0

    def acting_components(self, nv: int) -> list[int]:
        return np.flatnonzero(self.d).tolist()

    def effort(self, q: Array, v: Array) -> Effort:
        return 0.0, -self.d * np.tanh(v / self.v0)

    def core_data(self) -> dict[str, Any]:
        return {"kind": "friction", "a": [*self.d.tolist(), self.v0]}


class KineticFrictionElement(JointElement):
    """tau = -d * sign with d (nv,); sign (nv,): direction of slip in a mode, 0 for sticking joints."""

    by_state = False

    def __init__(self, name: str, d: Array) -> None:
        super().__init__(name, range(len(d)))
        self.d, self.sign = d, np.zeros_like(d)

    def effort(self, q: Array, v: Array) -> Effort:
        return 0.0, -self.d * self.sign

    def core_data(self) -> dict[str, Any]:
        return {"kind": "friction", "a": [*(self.d * self.sign).tolist(), 0.0]}
