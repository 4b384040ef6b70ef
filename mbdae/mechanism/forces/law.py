"""What a force is: a description that stands in a file binds to a workspace and becomes a law.

A law's generalised force tau (nv,) comes in two parts, one that derives from its potential and one whose work is
integrated along the motion. Laws with states s of their own, s' = h(t, q, v, s), are `StateLaw`.
"""

from collections.abc import Callable, Sequence
from math import inf

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array
from ..callbacks import called, checked
from ..signals import Constant, Signal
from ..tables import Table

Part = np.ndarray | float
TorqueFunction = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


class Law:
    """A force bound to a workspace whose kinematics stand at q when it is called.

    Args:
        name: for messages.
        signals: the functions of time in it.
    """

    def __init__(self, name: str, signals: Sequence[Signal] = ()) -> None:
        self.name, self.signals = name, [s for s in signals if not isinstance(s, Constant)]

    def torque(self, t: float, q: Array, v: Array) -> tuple[Part, Part]:
        """Return the conservative and the other part of tau, (nv,) each, or 0."""
        return 0.0, 0.0

    def potential(self, q: Array) -> float:
        """Potential energy in J."""
        return 0.0

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, where the law may jump; sign * inf if none."""
        return sign * min((sign * s.jump(t, sign) for s in self.signals), default=inf)


class StateLaw(Law):
    """A law with ns states of its own: tau(t, q, v, s), s' = h(t, q, v, s), and jumps of s at certain times.

    Attributes:
        states: names of the states and their start values.
    """

    states: dict[str, float]

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
        """Return tau (nv,), whose work is integrated, and s' (ns,)."""
        raise NotImplementedError

    def jump(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return s just after time t, (ns,); kinematics do not stand at q."""
        return s


class TorqueLaw(Law):
    """A function tau(t, q, v) -> (nv,) of the user; its work is integrated."""

    def __init__(self, name: str, function: TorqueFunction) -> None:
        super().__init__(name)
        self.function = function

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        what = f"force {self.name!r}"
        return 0.0, checked(called(what, self.function, t, q, v), v.shape, t, what)


class Laws:
    """All laws of a workspace, and the states of those that have some, one behind the other: s (ns,).

    Attributes:
        plain: the laws without states.
        stateful: the laws with states, and where theirs stand in s.
        ns: number of states.
    """

    def __init__(self, laws: Sequence[Law], nv: int) -> None:
        self.plain = [law for law in laws if not isinstance(law, StateLaw)]
        self.stateful: list[tuple[StateLaw, slice]] = []
        self.names, self.nv, self.ns = [law.name for law in laws], nv, 0
        for law in laws:
            if isinstance(law, StateLaw):
                self.stateful.append((law, slice(self.ns, self.ns + len(law.states))))
                self.ns += len(law.states)

    def states(self) -> dict[str, float]:
        """Names ``law.state`` and start values of all states, in the order of s.

        Raises:
            InputError: if two laws with states share a name.
        """
        names = [law.name for law, _ in self.stateful]
        if len(set(names)) < len(names):
            raise InputError(f"actuators and controllers need names of their own, got {', '.join(names)}")
        return {f"{law.name}.{key}": value for law, _ in self.stateful for key, value in law.states.items()}

    def torque(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:
        """Return the sum of all tau (nv,), and s' and the power of what has no potential, (ns + 1,)."""
        conservative: Part = 0.0
        other, rates = np.zeros(self.nv), np.empty(self.ns + 1)
        for law in self.plain:
            c, o = law.torque(t, q, v)
            conservative, other = conservative + c, other + o
        for actuator, part in self.stateful:
            tau, rates[part] = actuator.evaluate(t, q, v, s[part])
            other = other + tau
        rates[-1] = other.dot(v)
        return conservative + other, rates

    def potential(self, q: Array) -> float:
        """Potential energy in J; the kinematics stand at q."""
        return sum(law.potential(q) for law in self.plain)

    def breakpoint(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, where a law may jump; sign * inf if none."""
        laws = [*self.plain, *(law for law, _ in self.stateful)]
        return sign * min((sign * law.breakpoint(t, sign) for law in laws), default=inf)

    def jump(self, t: float, q: Array, v: Array, s: Array) -> Array:
        """Return s just after time t, (ns,); each law sees the states before."""
        out = s.copy()
        for actuator, part in self.stateful:
            out[part] = actuator.jump(t, q, v, s[part])
        return out


class Force(Table):
    """A force as it stands in a file.

    Attributes:
        name: the kind and a number when left out.
    """

    kind: str
    name: str = ""

    def bind(self, model: pin.Model, data: pin.Data) -> Law:
        """Return the law in a workspace.

        Raises:
            UnknownNameError, InputError: for frames and joints that do not exist or do not fit.
        """
        raise NotImplementedError
