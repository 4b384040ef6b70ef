"""A mechanism as an ordinary differential equation in local coordinates of its constraint manifold.

In the coordinates xi, eta of `mbdae.mechanism.equations.local_coordinates`, and the states s of forces,

    xi' = N^T L^-1 J v,   eta' = N_v^T L^-1 v',   s' = h(t, q, v, s, u),   v' from M v' = f + G^T lam, 0 = G v' + gamma

J is the tangent map at the displacement from q0. Every x of the ODE belongs to a state with g = 0 and G v + g_t = 0: no
solver can drift off the constraints. The coordinates are valid near q0; beyond, new coordinates are needed, see
`LocalODE.restart`.
"""

from collections.abc import Mapping
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError
from ...system import Array
from ..discrete_sensitivity.acceleration_sensitivity import AccelerationSensitivity
from ..discrete_sensitivity.parameter_direction import WIDTH
from ..discrete_sensitivity.parameter_partials import Parameters
from ..formulations.core_description import samplers_of
from ..formulations.index2 import Index2System
from ..inputs import Inputs
from ..time_functions.input_functions import InputSetting
from ..time_functions.perturbed_input import CommunicationStep, PerturbedInput
from .local_coordinates import LocalCoordinates

if TYPE_CHECKING:
    from ..mechanism import Mechanism

UNIT = 1.0 / WIDTH  # scale of an input, so that differences have a width of 1 in its unit: laws are linear in inputs


class OdeJacobian(NamedTuple):
    """Partial derivatives of x' with respect to x, (n, n), t, (n,), and the inputs, (n, m)."""

    x: Array
    t: Array
    u: Array


class LocalODE(LocalCoordinates):
    """x' = F(t, x, u) of a mechanism, x = (xi, eta, s), in local coordinates at a state.

    Call it as ``ode(t, x)`` or ``ode(t, x, u)``; not to be shared between threads.

    Args:
        mechanism: without stops, clutches or stiction; its inputs are u.
        t: time in s.
        q: consistent configuration (nq,), origin of the coordinates.
        v: consistent velocity (nv,).
        s: states of forces (ns,).
        native: the compiled core, which then computes v'.

    Attributes:
        x0: the state in these coordinates, (n,), xi = 0.
        n: degrees of freedom in position and in velocity, and states of forces.
        input_names: names of the inputs u (m,), see `mbdae.Input`.
        u0: their values at the start, (m,), used where u is omitted.

    Raises:
        InputError: for a state that is not consistent, a mechanism with modes, sampled controllers, or an input whose
            rate enters the accelerations (the speed of a driver).
        StepError: if the constraints are singular there.
    """

    def __init__(
        self, mechanism: "Mechanism", t: float, q: Array, v: Array, s: Array, native: ModuleType | None = None
    ) -> None:
        self.inputs = inputs = Inputs(mechanism)
        self.native, self.input_names, m = native, tuple(inputs.user_inputs), inputs.mechanism
        self.u0 = np.array([x.setting.value for x in inputs.user_inputs.values()])
        if m.switches:
            raise InputError(f"{m.title}: stops, clutches and stiction have modes, an ODE has none")
        super().__init__(_ode_system(inputs, native), t, m.point(q, v, t, s))

    def __repr__(self) -> str:
        return f"<ODE of {self.mechanism.title}: {' + '.join(map(str, self.sizes))} coordinates>"

    def _set(self, u: Array | None) -> None:
        """Set the inputs."""
        values = self.u0 if u is None else self.mechanism.vector("u", u, len(self.u0))
        for x, value in zip(self.inputs.user_inputs.values(), values.tolist(), strict=True):
            if x.setting.value != value:
                x.set(InputSetting(0.0, value))

    def __call__(self, t: float, x: Array, u: Array | None = None) -> Array:
        """Return x' (n,) for inputs u (m,).

        Raises:
            InputError: unless t, x and u are finite numbers of the right shapes.
            StepError: beyond the range of the coordinates, or where v' does not exist.
        """
        self._set(u)
        displacement, y, _ = self._point(t, x)
        nv, F = self.mechanism.nv, self.system.derivative(t, y)[0]
        dxi = self._N.T @ (self.system.manifold.tangent(displacement, F[:nv]) / self._scales)
        return np.concatenate([dxi, self._Nv.T @ (F[nv : 2 * nv] / self._scales), F[2 * nv : -1]])

    def restart(self, t: float, x: Array) -> "LocalODE":
        """Return the ODE in new coordinates, with their origin at x; its ``x0`` is the same state."""
        return LocalODE(self.inputs.original, t, *self.state(t, x), native=self.native)

    @cached_property
    def _sensitivity(self) -> AccelerationSensitivity:
        values = dict.fromkeys(self.input_names, UNIT)
        parameters = Parameters(self._perturbed, values, are_defaults=True, system=self.system)
        return AccelerationSensitivity(self.system, parameters)

    def _perturbed(self, values: Mapping[str, float]) -> "Mechanism":
        """Return the mechanism with one input perturbed."""
        if not values:
            return self.mechanism
        change = {name: values.get(name, UNIT) - UNIT for name in self.input_names}
        inputs, step = self.inputs.user_inputs, CommunicationStep()
        return self.inputs.replaced({n: PerturbedInput.of(u, step, change[n], change[n]) for n, u in inputs.items()})

    def jacobian(self, t: float, x: Array, u: Array | None = None) -> OdeJacobian:
        """Return the exact partial derivatives of x' with respect to x, t and u.

        A directional derivative is ``J.x @ dx + J.u @ du``, an adjoint ``bar @ J.x, bar @ J.u``.

        Raises:
            InputError, StepError: as a call.
        """
        self._set(u)
        y = self._point(t, x)[1]
        s, nv, (k, *_), D = self.system, self.mechanism.nv, self.sizes, self._scales[:, None]
        v = s.split(y)[1]
        rate = self._sensitivity.rate(t, y, multipliers=False).rate
        displacement, dx, dq, dv, ds = self.partials(t, x)
        both = rate[:, : 2 * nv + len(ds)] @ np.vstack([dq, dv, ds])
        both[:, -1] += rate[:, -1]
        tangent_rates = np.column_stack([s.manifold.tangent_rate(displacement, d, v) for d in dx.T])
        tangent_rates += np.column_stack([s.manifold.tangent(displacement, d) for d in dv.T])
        out = np.vstack([self._N.T @ (tangent_rates / D), self._Nv.T @ (both[nv : 2 * nv] / D), both[2 * nv : -1]])
        of_u = rate[:, s.ny : s.ny + len(self.u0)]
        by_u = np.vstack([np.zeros((k, len(self.u0))), self._Nv.T @ (of_u[nv : 2 * nv] / D), of_u[2 * nv : -1]])
        return OdeJacobian(out[:, :-1], out[:, -1], by_u)


def _ode_system(inputs: Inputs, native: ModuleType | None) -> Index2System:
    """Return a workspace.

    Raises:
        InputError: for an input whose rate enters the accelerations, or sampled controllers.
    """
    m = inputs.mechanism
    if inputs.rate_dependent:
        name = min(inputs.rate_dependent)
        raise InputError(f"{m.title}: v' depends on the rate of input {name!r}, F(t, x, u) only on values")
    system = m.system(native=native)
    if samplers_of(system.laws):
        raise InputError(f"{m.title}: the states of sampled controllers jump, those of an ODE do not")
    return system


def max_coordinates(mechanism: "Mechanism") -> int:
    """Return the number of local coordinates at the start; with modes, of the idle mode, which has the most.

    Raises:
        InputError: for an input whose rate enters the accelerations, or sampled controllers.
    """
    system = _ode_system(Inputs(mechanism), None)
    m = system.mechanism
    system.enter((0,) * len(m.switches))
    return LocalCoordinates(system, 0.0, m.point(*m.start)).n
