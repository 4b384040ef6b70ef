"""Springs, dampers and force actuators between two points."""

from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from ...tolerances import EVALUATION_ROUNDING
from ..key_units import Unit
from ..time_functions.time_functions import Constant, TimeFunction
from ..tree.frames import Pair, anchor, skew, unit_gap
from ..tree.wrench_partials import gap_wrench_partials, line_wrench_partials
from .force import Array, ArrayOrZero, CoreData, Force, ForceElement, FramePair, PairElement, WrenchPartials


class SpringDamper(Force):
    """A spring, damper and actuator between the origins of two frames.

    The tension is stiffness (d - length) + damping d' - force, with d the distance between the origins in m.

    Attributes:
        frames: names of both frames.
        stiffness: stiffness in N/m.
        damping: damping coefficient in N s/m.
        length: rest length in m.
        force: actuator force in N, a constant or a function of time; if positive, it pushes the frames apart.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["spring_damper"] = "spring_damper"
    frames: FramePair
    stiffness: Annotated[float, Unit("N/m")] = 0.0
    damping: Annotated[float, Unit("N s/m")] = Field(default=0.0, ge=0)
    length: Annotated[float, Unit("m")] = Field(default=0.0, ge=0)
    force: Annotated[TimeFunction, Unit("N")] = Constant(value=0.0)

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        a, b = self.frames
        return SpringDamperElement(self, Pair(model, data, anchor(model, a), anchor(model, b)))


class SpringDamperElement(PairElement):
    """The law of `SpringDamper`."""

    tension = True
    deflections = ((-1, ""),)

    def deflection(self, q: Array) -> Array:
        self.pair.locate()
        return np.array([unit_gap(self.pair)[0] - self.spec.length])

    def __init__(self, spec: SpringDamper, pair: Pair) -> None:
        super().__init__(spec.name, [spec.force])
        self.spec, self.pair = spec, pair
        if spec.stiffness * spec.length or spec.force != Constant(value=0.0):
            self.reversing_pair = pair

    def direction_undefined(self) -> bool:
        self.pair.locate()
        a, b = self.pair.pa, self.pair.pb
        directed = self.spec.damping or self.reversing_pair
        return bool(directed and np.abs(b - a).max() <= EVALUATION_ROUNDING * (1 + np.abs(a).max()))

    def spring_force(self, n: Array) -> Array:
        """Return the force of the spring on b, (3,), for the unit vector n from a to b; linear for length 0."""
        return -self.spec.stiffness * (self.pair.pb - self.pair.pa - self.spec.length * n)

    def generalized_force(self, t: float, q: Array, v: Array) -> tuple[Array, ArrayOrZero]:
        self.pair.locate()
        P, n = skew(self.pair.pb), unit_gap(self.pair)[1]
        spring, other = self.spring_force(n), self.spec.force.at(t)
        line = self.pair.generalized_force(np.concatenate([n, P @ n]))  # d' = line . v
        if self.spec.damping:
            other -= self.spec.damping * float(line @ v)
        return self.pair.generalized_force(np.concatenate([spring, P @ spring])), other * line if other else 0.0

    def wrench_partials(self, t: float, V: Array) -> tuple[WrenchPartials, WrenchPartials]:
        spec, (w, Da, Db), (distance, n) = self.spec, line_wrench_partials(self.pair), unit_gap(self.pair)
        N = -spec.stiffness * (np.eye(3) - spec.length / distance * (np.eye(3) - np.outer(n, n)))
        spring = WrenchPartials(*gap_wrench_partials(self.pair, self.spring_force(n), N), np.zeros((6, 6)))
        other, D = spec.force.at(t) - spec.damping * w.dot(V), -spec.damping * w[:, None]
        return spring, WrenchPartials(other * w, other * Da + D * V.dot(Da), other * Db + D * V.dot(Db), D * w)

    def wrench_time_rate(self, t: float) -> Array:
        return self.spec.force.derivative(t) * line_wrench_partials(self.pair)[0]

    def potential(self, q: Array) -> float:
        self.pair.locate()
        return 0.5 * self.spec.stiffness * (unit_gap(self.pair)[0] - self.spec.length) ** 2

    def core_data(self) -> CoreData:
        s = self.spec
        constants = {"frames": self.pair, "a": [s.stiffness, s.damping, s.length]}
        return {"kind": "spring_damper", **constants, "signals": [s.force.core_data()]}
