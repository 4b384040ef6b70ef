"""Python functions tau(t, q, v) as forces."""

from collections.abc import Callable

import pinocchio as pin

from ...callbacks import call_with_views, checked_value, function_name
from .force import Array, CoreData, ForceElement
from .python_law_partials import law_partials, law_time_partials, python_core_data

TorqueFunction = Callable[[float, Array, Array], Array]


class TorqueElement(ForceElement):
    """A user function tau(t, q, v) -> (nv,), treated as non-conservative: its work is integrated.

    The function may have an attribute ``partials``, a function (t, q, v) -> [dtau/dq, dtau/dv], (nv, 2 nv), q in the
    tangent space; otherwise implicit methods use central differences.
    """

    def __init__(self, function: TorqueFunction, model: pin.Model) -> None:
        super().__init__(function_name(function))
        self.function, self.model = function, model
        self.finite_differences = getattr(function, "partials", None) is None
        self.what = f"force {self.name!r}"

    def generalized_force(self, t: float, q: Array, v: Array) -> tuple[float, Array]:
        return 0.0, checked_value(call_with_views(self.what, self.function, t, q, v), v.shape, t, self.what)

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        user_partials = getattr(self.function, "partials", None)
        def tau(q: Array, v: Array, s: Array) -> Array:
            return self.generalized_force(t, q, v)[1]

        return law_partials(tau, user_partials, self.what, self.model, t, q, v, s)

    def time_partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        return law_time_partials(lambda t: self.generalized_force(t, q, v)[1], t, v)

    def core_data(self) -> CoreData:
        return python_core_data(self)
