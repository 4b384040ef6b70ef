"""Coulomb friction in joints, regularized or exact."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ...errors import InputError
from ..key_units import Unit
from ..tree.frames import find_joints, joint_names
from ..tree.tree_terms import mode_joints
from .force import Array, CoreData, Force, ForceElement, Joints
from .joint_law import Effort, JointElement

DEFAULT_VELOCITY = 0.01  # rad/s or m/s


class StictionJoint(NamedTuple):
    """A joint with exact Coulomb friction.

    Attributes:
        joint: name of the joint.
        force: name of the friction force.
        kinetic: kinetic friction torque or force, while the joint slips, in N m or N.
        static: largest friction torque or force while the joint sticks, in N m or N.
    """

    joint: str
    force: str
    kinetic: float
    static: float


class JointFriction(Force):
    """Coulomb friction on each coordinate of the joints, regularized or exact.

    Regularized: tau = -friction * tanh(v / velocity). A loaded joint then creeps, and the problem is stiff.

    Exact, if ``static`` is given or ``exact`` is true: a joint slips, tau = -friction * sign(v), or sticks, v = 0,
    as long as |tau| <= ``static``. A run locates these transitions, see `mbdae.mechanism.hybrid`;
    outside of runs there is no friction.

    Attributes:
        joint: one joint or several; all joints but modes of flexible bodies if omitted.
        friction: kinetic friction in N m or N; if omitted, the values of the imported model for each coordinate, URDF
            ``<dynamics friction>`` and MJCF ``frictionloss``.
        velocity: speed at which regularized friction reaches 76 % of its value, in rad/s or m/s; 0.01 if omitted. The
            time constant of the problem, inertia * velocity / friction, decreases with it.
        static: largest friction of a sticking joint, in N m or N, at least ``friction``, which is the default.
        exact: whether the joint can stick; true if ``static`` is given.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["joint_friction"] = "joint_friction"
    joint: Joints | None = None
    friction: Annotated[float | None, Unit("e")] = Field(default=None, ge=0)
    velocity: Annotated[float | None, Unit("q/s")] = Field(default=None, gt=0)
    static: Annotated[float | None, Unit("e")] = Field(default=None, ge=0)
    exact: bool = False

    @model_validator(mode="after")
    def _check_keys(self) -> "JointFriction":
        if self.is_exact and self.velocity is not None:
            raise ValueError("velocity belongs to regularized friction, not to static or exact")
        if self.static is not None and self.static < (self.friction or 0.0):
            raise ValueError(f"static is at least friction, {self.friction:g}, got {self.static:g}")
        return self

    @property
    def is_exact(self) -> bool:
        """Whether the friction is exact, so that joints can stick."""
        return self.exact or self.static is not None

    def stiction_joints(self, model: pin.Model) -> Iterator[StictionJoint]:
        """Yield the joints with stiction; none for regularized friction.

        Raises:
            InputError: for a joint of several coordinates, or static friction below the kinetic friction of the model.
        """
        if not self.is_exact:
            return
        source = self._kinetic_limits(model)
        for name in self._joints(model):
            (j,) = find_joints(model, name)
            if self.joint and j.nv != 1:
                raise InputError(f"exact friction needs a joint of one degree of freedom; {name!r} has {j.nv}")
            kinetic = float(source[j.idx_v : j.idx_v + j.nv].max(initial=0.0))
            static = kinetic if self.static is None else self.static
            if kinetic > static:
                raise InputError(f"force {self.name!r}: static is at least the {kinetic:g} of joint {name!r}")
            if j.nv == 1 and static:
                yield StictionJoint(name, self.name, kinetic, static)
            elif kinetic:
                raise InputError(f"exact friction needs a joint of one degree of freedom; {name!r} has {j.nv}")

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        d = self._kinetic_limits(model)
        if not d.any() and self.friction is None:
            raise InputError(f"the model has no friction for force {self.name!r}: set friction = ...")
        return (
            KineticFrictionElement(self.name, d)
            if self.is_exact
            else FrictionElement(self.name, d, self.velocity or DEFAULT_VELOCITY)
        )

    def _joints(self, model: pin.Model) -> Sequence[str]:
        if self.joint:
            return [self.joint] if isinstance(self.joint, str) else self.joint
        modes = set(mode_joints(model))
        return [name for name in joint_names(model) if name not in modes]

    def _kinetic_limits(self, model: pin.Model) -> Array:
        d, source = np.zeros(model.nv), np.array(model.upperDryFrictionLimit)
        for j in find_joints(model, self._joints(model)):
            at = slice(j.idx_v, j.idx_v + j.nv)
            d[at] = source[at] if self.friction is None else self.friction
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

    def core_data(self) -> CoreData:
        return {"kind": "friction", "a": [*self.d.tolist(), self.v0]}


class KineticFrictionElement(JointElement):
    """tau = -d * sign with d (nv,); sign (nv,) is the direction of slip in a mode, 0 for sticking joints."""

    depends_on_state_only = False

    def __init__(self, name: str, d: Array) -> None:
        super().__init__(name, range(len(d)))
        self.d, self.sign = d, np.zeros_like(d)

    def effort(self, q: Array, v: Array) -> Effort:
        return 0.0, -self.d * self.sign

    def core_data(self) -> CoreData:
        return {"kind": "friction", "a": [*(self.d * self.sign).tolist(), 0.0]}
