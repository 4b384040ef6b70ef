"""Forces and torques applied to a frame."""

from typing import Annotated, Literal

import numpy as np
import pinocchio as pin

from ..key_units import Unit
from ..time_functions.time_functions import Constant, TimeFunction
from ..tree.frames import WORLD, Pair, anchor, skew
from ..tree.wrench_partials import moved_line_partials
from .force import Array, ArrayOrZero, CoreData, Force, ForceElement, PairElement, WrenchPartials

ZERO = Constant(value=0.0)
Vector = tuple[TimeFunction, TimeFunction, TimeFunction]


class Wrench(Force):
    """A force at the origin of a frame and a torque, constants or functions of time: tau = J^T [force; torque].

    Attributes:
        frame: frame on which the force and the torque act.
        force: components of the force in N, (3,).
        torque: components of the torque in N m, (3,).
        axes: axes of the components: ``"world"``, or ``"frame"`` for axes that rotate with the frame.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["wrench"] = "wrench"
    frame: str
    force: Annotated[Vector, Unit("N")] = (ZERO,) * 3
    torque: Annotated[Vector, Unit("N m")] = (ZERO,) * 3
    axes: Literal["world", "frame"] = "world"

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        return WrenchElement(self, Pair(model, data, anchor(model, WORLD), anchor(model, self.frame)))


class WrenchElement(PairElement):
    """The law of `Wrench`: a constant force in the axes of the world has the potential -F . p."""

    def __init__(self, spec: Wrench, pair: Pair) -> None:
        super().__init__(spec.name, [*spec.force, *spec.torque])
        self.spec, self.pair = spec, pair
        self.has_potential = spec.axes == "world" and all(isinstance(s, Constant) for s in spec.force)

    def generalized_force(self, t: float, q: Array, v: Array) -> tuple[ArrayOrZero, ArrayOrZero]:
        self.pair.locate()
        n, m = self.vectors(t)
        force = self.pair.generalized_force(np.concatenate([n, skew(self.pair.pb) @ n]))
        moment = self.pair.generalized_force(np.concatenate([np.zeros(3), m])) if m.any() else np.zeros_like(v)
        return (force, moment) if self.has_potential else (0.0, force + moment)

    def wrench_time_rate(self, t: float) -> Array:
        n, m = self.vectors(t, derivative=True)
        return np.concatenate([n, m + skew(self.pair.pb) @ n])

    def vectors(self, t: float, *, derivative: bool = False) -> tuple[Array, Array]:
        """Return force and torque in the axes of the world, or their partial time derivatives, (3,) each."""
        vectors = (self.spec.force, self.spec.torque)
        n, m = (np.array([s.derivative(t) if derivative else s.at(t) for s in vector]) for vector in vectors)
        return (self.pair.Rb @ n, self.pair.Rb @ m) if self.spec.axes == "frame" else (n, m)

    def wrench_partials(self, t: float, V: Array) -> tuple[WrenchPartials, WrenchPartials]:
        n, m = self.vectors(t)
        P, Db, zero = skew(self.pair.pb), moved_line_partials(self.pair.pb, n[:, None])[0], np.zeros((6, 6))
        force, moment = np.concatenate([n, P @ n]), np.concatenate([np.zeros(3), m])
        if self.spec.axes == "frame":
            Db[:3, 3:] -= skew(n)
            Db[3:, 3:] -= P @ skew(n) + skew(m)
        if self.has_potential:
            return WrenchPartials(force, zero, Db, zero), WrenchPartials(moment, zero, zero, zero)
        return WrenchPartials(np.zeros(6), zero, zero, zero), WrenchPartials(force + moment, zero, Db, zero)

    def potential(self, q: Array) -> float:
        if not self.has_potential:
            return 0.0
        self.pair.locate()
        return -float(np.array([s.at(0.0) for s in self.spec.force]) @ self.pair.pb)

    def core_data(self) -> CoreData:
        s = self.spec
        flags = {"rotating": s.axes == "frame", "has_potential": self.has_potential}
        signals = [x.core_data() for x in (*s.force, *s.torque)]
        return {"kind": "wrench", "frames": self.pair, **flags, "signals": signals}
