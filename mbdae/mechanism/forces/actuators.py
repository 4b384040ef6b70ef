"""Forces with states of their own: Python actuators and DC motors. The states are integrated with the motion."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ...errors import InputError
from ..callbacks import called, checked, function_name
from ..frames import find_joint
from ..signals import Signal
from .law import Array, Force, Law, StateLaw

StateFunction = Callable[[float, Array, Array, Array], Array]


@dataclass(frozen=True)
class Actuator:
    """A force with ns states s of its own, as Python functions of (t, q, v, s).

        tau = torque(t, q, v, s),   s' = rate(t, q, v, s)

    The states count in the error control; ``sol.s`` returns them.

    Args:
        torque: generalised force, (nv,) in N m and N; its work is integrated.
        rate: rates of the states, (ns,).
        start: names of the states and their start values.
        name: of the torque function when left out.

    Raises:
        InputError: for states that are not names and finite numbers.

    Example:
        >>> motor = Actuator(torque, rate, start={"current": 0.0}, name="motor")   # doctest: +SKIP
    """

    torque: StateFunction
    rate: StateFunction
    start: Mapping[str, float]
    name: str = field(default="")

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", function_name(self.torque))
        object.__setattr__(self, "start", start_values(self.name, self.start))
        if not self.start:
            raise InputError(f"actuator {self.name!r} has no states: use a function tau(t, q, v)")

    def bind(self, model: pin.Model, data: pin.Data) -> "ActuatorLaw":
        """Return the law in a workspace."""
        return ActuatorLaw(self)


class ActuatorLaw(StateLaw):
    """The law of `Actuator`."""

    def __init__(self, spec: Actuator) -> None:
        super().__init__(spec.name)
        self.spec, self.states = spec, dict(spec.start)

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:  # noqa: D102
        what = [f"{part} of actuator {self.name!r}" for part in ("torque", "rate")]
        tau = checked(called(what[0], self.spec.torque, t, q, v, s), v.shape, t, what[0])
        return tau, checked(called(what[1], self.spec.rate, t, q, v, s), s.shape, t, what[1])


class DCMotor(Force):
    """A DC motor on a joint: tau = gear constant i,   inductance i' = voltage(t) - resistance i - constant gear v.

    The rotor's inertia, gear^2 J, belongs to the joint's armature. Without inductance the current has no state.

    Attributes:
        joint: a joint with one velocity.
        voltage: V, a constant or a function of time.
        resistance: ohm.
        inductance: H.
        constant: torque per current in N m/A, the same as voltage per speed in V s/rad.
        gear: turns of the rotor per turn of the joint.
        current: at the start, in A.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is made, for a joint or frame that it does not have.
    """

    kind: Literal["dc_motor"] = "dc_motor"
    joint: str
    voltage: Signal
    resistance: float = Field(ge=0)
    inductance: float = Field(default=0.0, ge=0)
    constant: float
    gear: float = 1.0
    current: float = 0.0

    @model_validator(mode="after")
    def _has_current(self) -> "DCMotor":
        if not (self.resistance or self.inductance):
            raise ValueError("a dc_motor needs a resistance or an inductance")
        if self.current and not self.inductance:
            raise ValueError("the current of a dc_motor without inductance has no start value")
        return self

    def bind(self, model: pin.Model, data: pin.Data) -> Law:  # noqa: D102
        j = find_joint(model, self.joint)
        if j.nv != 1:
            raise InputError(f"a dc_motor needs a joint with one velocity; {self.joint!r} has {j.nv}")
        return MotorLaw(self, j.idx_v) if self.inductance else ResistanceLaw(self, j.idx_v)


class MotorLaw(StateLaw):
    """The law of `DCMotor` with the current as its state."""

    def __init__(self, spec: DCMotor, iv: int) -> None:
        super().__init__(spec.name, [spec.voltage])
        self.spec, self.iv, self.k = spec, iv, spec.gear * spec.constant
        self.states = {"current": spec.current}

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[Array, Array]:  # noqa: D102
        tau = np.zeros_like(v)
        tau[self.iv] = self.k * s[0]
        voltage = self.spec.voltage.at(t) - self.spec.resistance * s - self.k * v[self.iv]
        return tau, voltage / self.spec.inductance


class ResistanceLaw(Law):
    """The law of `DCMotor` without inductance."""

    def __init__(self, spec: DCMotor, iv: int) -> None:
        super().__init__(spec.name, [spec.voltage])
        self.spec, self.iv, self.k = spec, iv, spec.gear * spec.constant

    def torque(self, t: float, q: Array, v: Array) -> tuple[float, Array]:  # noqa: D102
        tau = np.zeros_like(v)
        tau[self.iv] = self.k * (self.spec.voltage.at(t) - self.k * v[self.iv]) / self.spec.resistance
        return 0.0, tau


def start_values(name: str, start: Mapping[str, float]) -> dict[str, float]:
    """Return names and start values of states as plain numbers.

    Raises:
        InputError: for anything else.
    """
    numbers = isinstance(start, Mapping) and all(
        isinstance(x, int | float | np.number) and np.isfinite(x) for x in start.values()
    )
    if not numbers:
        raise InputError(f"the states of {name!r} start from a table of names and finite numbers, got {start!r:.80}")
    return {str(key): float(value) for key, value in start.items()}
