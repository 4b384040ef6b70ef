"""Springs, dampers and force actuators between two points."""

from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from ...tolerances import EVALUATION_ROUNDING
from ..key_units import Unit
from ..time_functions.time_functions import Constant, TimeFunction
from ..tree.frames import Pair, anchor, skew, unit_gap
from ..tree.wrench_partials import line_wrench_partials
from .force import Array, ArrayOrZero, CoreData, Force, ForceElement, PairElement, WrenchPartials


class SpringDamper(Force):
    """A spring, damper and actuator between the origins of two frames.

    The tension is stiffness (d - length) + damping d' - force, with d the distance of the origins in m.

    Attributes:
        frames: names of both frames.
        stiffness: N/m.
        damping: N s/m.
        length: rest length in m.
        force: N, a constant or a function of time; it pushes the frames apart.
        name: for parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["spring_damper"] = "spring_damper"
    frames: tuple[str, str]
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

    def direction_undefined(self) -> bool:
        self.pair.locate()
        (a, b), spec = (self.pair.pa, self.pair.pb), self.spec
        linear = not (spec.damping or spec.stiffness * spec.length or spec.force != Constant(value=0.0))
        return not linear and bool(np.abs(b - a).max() <= EVALUATION_ROUNDING * (1 + np.abs(a).max()))

    def torque(self, t: float, q: Array, v: Array) -> tuple[Array, ArrayOrZero]:
        self.pair.locate()
        distance, n = unit_gap(self.pair)
        line = self.pair.torque(np.concatenate([n, skew(self.pair.pb) @ n]))  # d' = line . v
        other = self.spec.force.at(t)
        if self.spec.damping:
            other -= self.spec.damping * float(line @ v)
        return -self.spec.stiffness * (distance - self.spec.length) * line, other * line if other else 0.0

    def wrench_partials(self, t: float, V: Array) -> tuple[WrenchPartials, WrenchPartials]:
        spec, (w, Da, Db) = self.spec, line_wrench_partials(self.pair)
        T, other = spec.stiffness * (unit_gap(self.pair)[0] - spec.length), spec.force.at(t) - spec.damping * w.dot(V)
        K, D = spec.stiffness * np.outer(w, w), -spec.damping * w[:, None]
        spring = WrenchPartials(-T * w, K - T * Da, -K - T * Db, np.zeros((6, 6)))
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
