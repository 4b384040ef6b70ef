"""DC motors, with currents as states."""

from typing import Annotated, Literal

import pinocchio as pin
from pydantic import Field, model_validator

from ..key_units import Unit
from ..time_functions.time_functions import TimeFunction
from .force import Force, ForceElement, single_velocity_joint
from .linear import LinearElement, Term


class DCMotor(Force):
    """A DC motor on a joint: tau = gear constant i,   inductance i' = voltage(t) - resistance i - constant gear v.

    The rotor's inertia, gear^2 J, belongs to the joint's armature. Without inductance the current is not a state.

    Attributes:
        joint: a joint with one velocity.
        voltage: voltage in V, a constant or a function of time.
        resistance: resistance in ohm.
        inductance: inductance in H.
        constant: motor constant, torque per current in N m/A, equal to voltage per speed in V s/rad.
        gear: gear ratio, rotor angle per joint angle.
        current: initial current in A.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["dc_motor"] = "dc_motor"
    joint: str
    voltage: Annotated[TimeFunction, Unit("V")]
    resistance: Annotated[float, Unit("ohm")] = Field(ge=0)
    inductance: Annotated[float, Unit("H")] = Field(default=0.0, ge=0)
    constant: Annotated[float, Unit("N m/A")]
    gear: Annotated[float, Unit("rad/q")] = 1.0
    current: Annotated[float, Unit("A")] = 0.0

    @model_validator(mode="after")
    def _check_circuit(self) -> "DCMotor":
        if not (self.resistance or self.inductance):
            raise ValueError("a dc_motor needs a resistance or an inductance")
        if self.current and not self.inductance:
            raise ValueError("the current of a dc_motor without inductance has no start value")
        if not self.constant * self.gear:
            raise ValueError("a dc_motor whose constant or gear is 0 has no torque")
        return self

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        i, k = single_velocity_joint(model, self.joint, f"dc_motor {self.name!r}").idx_v, self.gear * self.constant
        R, L = self.resistance, self.inductance
        if not L:
            terms: list[Term] = [("tau", i, "u", 0, k / R), ("tau", i, "v", i, -k * k / R)]
            return LinearElement(self.name, terms, time_functions=[self.voltage])
        terms = [("tau", i, "s", 0, k), ("ds", 0, "u", 0, 1 / L), ("ds", 0, "s", 0, -R / L), ("ds", 0, "v", i, -k / L)]
        return LinearElement(self.name, terms, time_functions=[self.voltage], states={"current": self.current})
