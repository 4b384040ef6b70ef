"""Forces with internal states, as Python functions; the states are integrated with the motion."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from ...callbacks import call_with_views, checked_value, function_name
from ...errors import InputError
from .force import Array, CoreData, ForceElement, PythonForce, start_values
from .python_law_partials import law_partials, law_time_partials, python_core_data

StateFunction = Callable[[float, Array, Array, Array], Array]


@dataclass(frozen=True)
class Actuator(PythonForce):
    """A force with ns internal states s, as Python functions of (t, q, v, s).

        tau = torque(t, q, v, s),   s' = rate(t, q, v, s)

    The states are included in the error control; ``sol.s`` returns them.

    Args:
        torque: generalized force, (nv,) in N m and N; its work is integrated.
        rate: rates of the states, (ns,).
        start: names and initial values of the states.
        name: the name of the torque function if omitted.
        partials: (t, q, v, s) -> derivatives of (tau, s') with respect to (q in the tangent, v, s),
            (nv + ns, 2 nv + ns), for implicit methods; central differences if omitted.

    Raises:
        InputError: for invalid names of states, or initial values that are not finite.

    Example:
        >>> motor = Actuator(torque, rate, start={"current": 0.0}, name="motor")   # doctest: +SKIP
    """

    torque: StateFunction
    rate: StateFunction
    start: Mapping[str, float]
    name: str = field(default="")
    partials: StateFunction | None = None

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", function_name(self.torque))
        object.__setattr__(self, "start", start_values(self.name, self.start))
        if not self.start:
            raise InputError(f"actuator {self.name!r} has no states: use a function tau(t, q, v)")

    def bind(self, model: pin.Model, data: pin.Data) -> "ActuatorElement":
        """Return the law bound to a workspace."""
        return ActuatorElement(self, model)


class ActuatorElement(ForceElement):
    """The law of `Actuator`."""

    def __init__(self, spec: Actuator, model: pin.Model) -> None:
        super().__init__(spec.name, states=spec.start)
        self.spec, self.model = spec, model
        self.finite_differences = spec.partials is None

    def evaluate(self, t: float, q: Array, v: Array, s: Array) -> tuple[float, Array, Array]:
        what = [f"{part} of actuator {self.name!r}" for part in ("torque", "rate")]
        tau = checked_value(call_with_views(what[0], self.spec.torque, t, q, v, s), v.shape, t, what[0])
        return 0.0, tau, checked_value(call_with_views(what[1], self.spec.rate, t, q, v, s), s.shape, t, what[1])

    def time_partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        return law_time_partials(lambda t: np.concatenate(self.evaluate(t, q, v, s)[1:]), t, v)

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        def law(q: Array, v: Array, s: Array) -> Array:
            return np.concatenate(self.evaluate(t, q, v, s)[1:])

        return law_partials(law, self.spec.partials, f"actuator {self.name!r}", self.model, t, q, v, s)

    def core_data(self) -> CoreData:
        return python_core_data(self)
