"""Dry friction of a closure from the force that it carries."""

from typing import Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from .force import Array, Force, ForceElement


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
        velocity: where the friction has reached three quarters of its value, in rad/s or m/s, as of `JointFriction`.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected; when a mechanism is made,
            for a closure that neither turns nor slides.
        UnknownNameError: when a mechanism is made, for a closure that it does not have.
    """

    kind: Literal["coulomb_friction"] = "coulomb_friction"
    closure: str
    coefficient: float = Field(ge=0)
    radius: float | None = Field(default=None, gt=0)
    velocity: float = Field(default=0.01, gt=0)

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:  # noqa: D102
        return CoulombElement(self.name)


class CoulombElement(ForceElement):
    """Nothing by q and v alone: what depends on multipliers is added by `mbdae.mechanism.formulations.sliding`."""

    by_state = False

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, float]:  # noqa: D102
        return 0.0, 0.0

    def slopes(self, t: float, q: Array, v: Array, s: Array) -> Array:  # noqa: D102
        return np.zeros((len(v) + len(s) + 1, 2 * len(v) + len(s)))
