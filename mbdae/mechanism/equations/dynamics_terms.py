"""Dynamics terms of a mechanism at a point: M, G, frames, bias forces (Coriolis, centrifugal, gravity), energies."""

from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin

from ...backend import select_core
from ...errors import InputError
from ...system import Array
from ...tolerances import HALF_DIGITS
from ..forces import is_custom
from ..tree.frames import frame_placement
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import bias, symmetric, update_inertia, update_motions
from .characteristic_length import characteristic_length, coordinate_scales, q_scales, row_scales
from .characteristic_rate import characteristic_rate
from .equations_at_point import EquationsAtPoint
from .local_ode import LocalODE

Self_: TypeAlias = Any  # a `Mechanism`, which derives from this class: a type checker rejects a derived type of self


class DynamicsTerms:
    """The terms of M(q) v' + nle(q, v) = tau + G(q)^T lam at a configuration (nq,) and a velocity (nv,)."""

    def at(
        self: Self_,
        t: float = 0.0,
        q: Array | None = None,
        v: Array | None = None,
        s: Array | None = None,
        *,
        mode: tuple[int, ...] = (),
        backend: str = "auto",
    ) -> EquationsAtPoint:
        """Return the terms of the equations of motion at a point, M, f, G, g, gamma, v', lam, and their derivatives.

        See `mbdae.mechanism.equations.equations_at_point.EquationsAtPoint`; without q and v at the start state.

        Args:
            t: time in s.
            q: configuration (nq,).
            v: velocity (nv,); zero if q is given alone.
            s: states of forces (ns,); start values if omitted.
            mode: the state of each switch (stops, clutches, sticking joints); by default rows of switches are inactive.
            backend: ``"auto"``, ``"native"`` or ``"python"``, for v' and lam.

        Raises:
            InputError: for wrong shapes, values that are not finite, or a q off the manifold.
            UnknownNameError: for another back end.

        Example:
            >>> point = mech.at(0.0, q, v)                                       # doctest: +SKIP
            >>> point.M @ point.vdot - point.f - point.G.T @ point.lam           # doctest: +SKIP
        """
        q0, v0 = self.start_at(t) if q is None else (q, np.zeros(self.nv))
        native = select_core(backend)
        if native and backend == "auto" and not self.workspaces.supported_by(native):
            native = None
        return EquationsAtPoint(self, t, q0, v0 if v is None else v, s, mode=mode, native=native)

    def ode(
        self: Self_,
        t: float = 0.0,
        q: Array | None = None,
        v: Array | None = None,
        s: Array | None = None,
        *,
        backend: str = "auto",
    ) -> LocalODE:
        """Return the mechanism as x' = F(t, x, u) in local coordinates of its constraint manifold, for any ODE solver.

        See `mbdae.mechanism.equations.local_ode.LocalODE`; without q and v at the start state.

        Args:
            t: time in s.
            q: configuration (nq,), origin of the coordinates.
            v: velocity (nv,); zero if q is given alone.
            s: states of forces (ns,); start values if omitted.
            backend: ``"auto"``, ``"native"`` or ``"python"``, for v'.

        Raises:
            InputError: for a state that is not consistent, a mechanism with modes, sampled controllers, or an input
                whose rate enters the accelerations.
            StepError: if the constraints are singular there.
            UnknownNameError: for another back end.

        Example:
            >>> ode = mech.ode()                                                 # doctest: +SKIP
            >>> run = solve_ivp(ode, (0, 1), ode.x0, method="LSODA")             # doctest: +SKIP
            >>> q, v, s = ode.state(run.t[-1], run.y[:, -1])                     # doctest: +SKIP
        """
        point = self.at(t, q, v, s, backend=backend)
        return LocalODE(self, point.t, point.q, point.v, point.s, point.native)

    @cached_property
    def characteristic_length(self: Self_) -> float:
        """Longest distance in m, l > 0, between joints and points where closures act: the unit of lengths."""
        return characteristic_length(self)

    @cached_property
    def characteristic_rate(self: Self_) -> float:
        """Rate w > 0 in 1/s of motions from the start: the unit of speeds, with the characteristic length."""
        return characteristic_rate(self)

    @property
    def characteristic_speed(self: Self_) -> float:
        """Characteristic length times characteristic rate, in m/s."""
        return self.characteristic_length * self.characteristic_rate

    @cached_property
    def row_scales(self: Self_) -> Array:
        """Unit scale of each row's g, (ng,): the characteristic length, or 1 rad."""
        return row_scales(self)

    @cached_property
    def q_scales(self: Self_) -> Array:
        """Unit scale of each component of q, (nq,): the characteristic length, or 1."""
        return q_scales(self)

    @cached_property
    def coordinate_scales(self: Self_) -> Array:
        """Unit scale of each velocity component's coordinate, (nv,): the characteristic length, or 1 rad."""
        return coordinate_scales(self)

    @property
    def motion_scales(self: Self_) -> Array:
        """Unit scale of each component of q in its tangent and of v, (2 nv,): for widths of differences."""
        return np.append(self.coordinate_scales, self.characteristic_rate * self.coordinate_scales)

    def make_workspace(self: Self_) -> pin.Data:
        """Create a workspace for closures and forces; with all of Pinocchio's data if custom forces are bound to it."""
        return make_data(self.model, complete=any(is_custom(f) for f in self.forces))

    @property
    def gravity(self: Self_) -> Array:
        """Gravity in m/s^2, (3,)."""
        return self.model.gravity.linear.copy()

    def mass_matrix(self: Self_, q: Array) -> Array:
        """Return M(q), symmetric, armature included, (nv, nv), in kg, kg m and kg m^2.

        Raises:
            InputError: for a q of another length, or off the manifold.
        """
        data = make_data(self.model)
        return symmetric(update_inertia(self.model, data, self.configuration(q)))

    def bias(self: Self_, q: Array, v: Array) -> Array:
        """Return nle(q, v), Coriolis, centrifugal and gravity terms, (nv,), in N m and N.

        Springs, dampers and other forces are not included.

        Raises:
            InputError: for arrays of another length.
        """
        data = make_data(self.model)
        return bias(self.model, data, self.configuration(q), self.vector("v", v, self.nv)).copy()

    def jacobian(self: Self_, q: Array) -> Array:
        """Return G(q), the rows of all closures and drivers in file order, (ng, nv).

        Raises:
            InputError: for a q of another length, or off the manifold.
        """
        with self.workspaces.borrowed() as system:
            return system.jacobian(self.configuration(q)).copy()

    def frame(self: Self_, q: Array, name: str) -> tuple[Array, Array]:
        """Return position (3,) in m and rotation matrix (3, 3) of a frame in the world.

        Raises:
            UnknownNameError: for an unknown frame.
            InputError: for a q of another length, or off the manifold.
        """
        data = make_data(self.model)
        update_motions(self.model, data, self.configuration(q))
        placement = frame_placement(self.model, data, name)
        return placement.translation.copy(), placement.rotation.copy()

    def energy(self: Self_, q: Array, v: Array) -> tuple[float, float]:
        """Return kinetic energy v^T M v / 2 (armature included) and potential energy of gravity and springs, in J."""
        with self.workspaces.borrowed() as system:
            return system.energy(np.asarray(q, float), np.asarray(v, float))

    def residual(self: Self_, q: Array, v: Array, t: float = 0.0) -> tuple[Array, Array]:
        """Return g(t, q) and G(q) v + g_t(t) of all rows, (ng,) each."""
        with self.workspaces.borrowed() as system:
            return system.residual(t, np.asarray(q, float), np.asarray(v, float))

    def configuration(self: Self_, q: Array) -> Array:
        """Return a q (nq,) after checks.

        Raises:
            InputError: for another length, values that are not finite, or a q off the manifold.
        """
        x = self.vector("q", q, self.nq)
        if not pin.isNormalized(self.model, x, HALF_DIGITS):
            raise InputError("q is not on the manifold: normalize its quaternions, or pass it through assemble(q, v)")
        return x
