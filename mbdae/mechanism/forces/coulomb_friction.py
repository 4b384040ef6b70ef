"""Dry friction of a closure from the force that it carries."""

from typing import Literal

import pinocchio as pin
from pydantic import Field, model_validator

from .force import Force, ForceElement
from .joint_friction import VELOCITY
from .linear import LinearElement


class CoulombFriction(Force):
    """Friction of a closure by its own reaction, mu |F| against sliding, mu r |F| against turning.

    F is the force between both bodies: all of it in a closure that turns (revolute, point); that across the axis in one
    that slides along it (prismatic, cylindrical, in_line); the normal force where bodies touch (in_plane, slot,
    rolling), which slide against the relative velocity of the point of contact. Forces depend on multipliers then, and
    not in a linear way: methods have their general order (`mbdae methods`), not that for f linear in z.

    Attributes:
        closure: name of the closure.
        coefficient: mu, without unit.
        radius: r of the bearing in m, of a closure that turns.
        velocity: where regularised friction has reached three quarters of its value, in rad/s or m/s, 0.01 when left
            out, as of `JointFriction`.
        static: mu of what grips, at least ``coefficient``, which is taken when left out.
        exact: a rolling body grips, with all rows of its grip, as long as that takes no more than mu_s N, and slides
            else; true where ``static`` is given. For closures of kind rolling, whose grip is kept otherwise.
        name: for parameters, signals and messages; the kind and a number when left out.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected; when a mechanism is made,
            for a closure that neither turns nor slides.
        UnknownNameError: when a mechanism is made, for a closure that it does not have.
    """

    kind: Literal["coulomb_friction"] = "coulomb_friction"
    closure: str
    coefficient: float = Field(ge=0)
    radius: float | None = Field(default=None, gt=0)
    velocity: float | None = Field(default=None, gt=0)
    static: float | None = Field(default=None, ge=0)
    exact: bool = False

    @model_validator(mode="after")
    def _fits(self) -> "CoulombFriction":
        if self.sticks and self.velocity is not None:
            raise ValueError("velocity belongs to regularised friction, not to static or exact")
        if self.static is not None and self.static < self.coefficient:
            raise ValueError(f"static is at least coefficient, {self.coefficient:g}, got {self.static:g}")
        return self

    @property
    def sticks(self) -> bool:
        """It is exact."""
        return self.exact or self.static is not None

    @property
    def width(self) -> float:
        """Where regularised friction has reached three quarters of its value."""
        return self.velocity or VELOCITY

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:  # noqa: D102
        return CoulombElement(self.name)


class CoulombElement(LinearElement):
    """No force by q and v alone: `mbdae.mechanism.formulations.closure_friction` adds friction by multipliers."""

    by_state = False
