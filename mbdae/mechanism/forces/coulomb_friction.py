"""Coulomb friction of a closure, proportional to its reaction force."""

from typing import Annotated, Literal

import pinocchio as pin
from pydantic import Field, model_validator

from ..key_units import Unit
from .force import Force, ForceElement
from .joint_friction import DEFAULT_VELOCITY
from .linear import LinearElement


class CoulombFriction(Force):
    """Coulomb friction of a closure from its reaction force: mu |F| against sliding, mu r |F| against rotation.

    F is the force between both bodies: the full force in a closure that rotates (revolute, point); the force
    perpendicular to the axis in one that slides along it (prismatic, cylindrical, in_line); the normal force at a
    contact (in_plane, slot, rolling), where friction opposes the relative velocity of the contact point. Forces then
    depend nonlinearly on multipliers: methods have their general order (`mbdae methods`), not that for f linear in z.

    Attributes:
        closure: name of the closure.
        coefficient: mu, dimensionless.
        radius: r of the bearing in m, for a closure that rotates.
        velocity: speed at which regularized friction reaches 76 % of its value, in rad/s or m/s; 0.01 if omitted, as
            in `JointFriction`.
        static: mu while sticking, at least ``coefficient``, which is the default.
        exact: whether a rolling body sticks, with all no-slip rows, while its friction is at most mu_s N, and slides
            otherwise; true if ``static`` is given. For closures of kind rolling, which otherwise never slide.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected; when a mechanism is created,
            for a closure that neither rotates nor slides.
        UnknownNameError: when a mechanism is created, for an unknown closure.
    """

    kind: Literal["coulomb_friction"] = "coulomb_friction"
    closure: str
    coefficient: Annotated[float, Unit("1")] = Field(ge=0)
    radius: Annotated[float | None, Unit("m")] = Field(default=None, gt=0)
    velocity: Annotated[float | None, Unit("q/s")] = Field(default=None, gt=0)
    static: Annotated[float | None, Unit("1")] = Field(default=None, ge=0)
    exact: bool = False

    @model_validator(mode="after")
    def _check_keys(self) -> "CoulombFriction":
        if self.is_exact and self.velocity is not None:
            raise ValueError("velocity belongs to regularized friction, not to static or exact")
        if self.static is not None and self.static < self.coefficient:
            raise ValueError(f"static is at least coefficient, {self.coefficient:g}, got {self.static:g}")
        return self

    @property
    def is_exact(self) -> bool:
        """Whether the friction is exact, so that the contact can stick."""
        return self.exact or self.static is not None

    @property
    def width(self) -> float:
        """Regularization width: the speed at which regularized friction reaches 76 % of its value, tanh 1."""
        return self.velocity or DEFAULT_VELOCITY

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        return CoulombElement(self.name)


class CoulombElement(LinearElement):
    """A law with zero force: `mbdae.mechanism.formulations.closure_friction` computes friction from multipliers."""

    depends_on_state_only = False
