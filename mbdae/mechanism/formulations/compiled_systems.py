"""Formulations computed by the compiled core: the functions of the Python systems, and whole steps.

The Python system is the specification. If the core cannot compute a point (a singular system, a value that is not
finite, a force law that raises an error), it falls back to Python, which raises the error with its message.
"""

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import NotCompiled
from ...system import Array, State, Step
from ..forces.joint_friction import KineticFrictionElement
from ..hybrid.switches import Mode
from ..time_functions.input_functions import Input
from .core_description import core_tolerances, describe, inputs_of, samplers_of
from .core_rank_loss import CoreRankLoss
from .core_start import CoreStart
from .equation_partials import EquationPartials
from .ggl import GGLSystem
from .index1 import Index1System

if TYPE_CHECKING:
    from ..._native import Core, Run
    from ..mechanism import Mechanism


class CompiledSystem(CoreStart, CoreRankLoss):
    """`mbdae.system.System` of a mechanism whose points and steps are computed by the core.

    Args:
        mechanism: the mechanism.
        native: the core, see `mbdae.backend`.

    Raises:
        NotCompiled: names the feature that the core does not support.
    """

    _method: tuple[Any, Any]  # the last method, and the core's version of it

    def __init__(self, mechanism: "Mechanism", native: ModuleType) -> None:
        self.native, self._expanded, self._method = native, False, (None, None)
        super().__init__(mechanism)

    def bind(self, mechanism: "Mechanism") -> None:
        """See `Index2System.bind`; parameters are written in place if the structure is the same."""
        super().bind(mechanism)
        data = self.model, core_tolerances(self.native, mechanism), describe(self)
        try:
            if not (hasattr(self, "core") and self.core.write(*data)):
                self.core: Core = self.native.Core(*data)
                self._expanded, self._method = False, (None, None)
        except self.native.UnknownKind as e:
            raise NotCompiled(str(e)) from None
        self.core.set_sampled_controllers(samplers_of(self.laws))
        friction = self.closure_friction
        self.core.set_friction_interfaces(friction.core_data(), friction.active, friction.slip_directions)
        self._mode_to_core()
        self.set_min_slip_speed(friction.min_slip_speed)
        self.inputs = inputs_of(self)

    def set_input(self, source: Input, number: int) -> None:
        """See `mbdae.mechanism.time_functions.input_functions.InputListener`."""
        if any(u is source for u in self.inputs):
            self.core.set_input(number, *source.setting)

    def reset(self) -> None:
        """See `Index2System.reset`."""
        super().reset()
        self._rank_known = False
        if hasattr(self, "core"):
            self.core.reset()
            self._mode_to_core()  # an interrupted run may have left the core in another mode

    def method(self, method: Any) -> Any:
        """Return the core's version of a method; an implicit method also needs the expanded tree."""
        if self._method[0] is not method:
            self._method = method, method.compiled(self.native)
            if not isinstance(self._method[1], self.native.Tableau):
                self.expand()
        return self._method[1]

    @property
    def accuracy(self) -> float:  # type: ignore[override]
        """See `mbdae.system.System`; stored in the core."""
        return self.core.accuracy if hasattr(self, "core") else 0.0

    @accuracy.setter
    def accuracy(self, value: float) -> None:
        if hasattr(self, "core"):
            self.core.accuracy = value

    def expand(self) -> None:
        """Pass the expanded tree to the core, which takes partial derivatives on it."""
        if not self._expanded:
            self.core.expand(self.inertial.model)
            self._expanded = True

    def determine_rank(self, t: float, y: Array) -> None:
        """Determine the rank and the rows in use at a point, unless they are known."""
        if not self._rank_known:
            self.derivative(t, y)

    def derivative(self, t: float, y: Array, guess: Array | None = None) -> tuple[Array, Array]:
        """See `Index2System.derivative`; the first call, which determines the rank, is computed in Python."""
        result = self.core.derivative(t, y) if self._rank_known else None
        self.take_core_record()
        if result is not None:
            return result
        self.rows_from_core()
        result = super().derivative(t, y, guess)
        self.rows_to_core()
        return result

    def compiled_step(self, method: object, t: float, h: float, state: State, controlled: bool = False) -> Step | None:
        """See `mbdae.system.System`; None if the core cannot take the step."""
        self.determine_rank(t, state.y)
        compiled, carry = self.method(method), self.core_carry(state)
        if compiled is None:
            self.rows_from_core()
            return None
        implicit = (controlled,) if isinstance(compiled, self.native.Radau) else ()
        result = self.core.step(compiled, t, h, state.y, carry, state.compensation, *implicit)
        self.take_core_record()
        if result is None:
            self.rows_from_core()
            return None
        y, carry, compensation, z, errors = result
        return Step(State(y, carry, compensation), z, errors)

    def core_carry(self, state: State) -> Any:
        """Return the carry of the core; None if the carry was computed in Python."""
        known = state.carry is not None and isinstance(state.carry, np.ndarray | self.native.StageMemory)
        return state.carry if known else None

    def advance(self, method: Any, run: "Run") -> None:
        """Take many steps, see `mbdae.integrate.steppers.native`; the run keeps them even if interrupted."""
        try:
            self.core.advance(self.method(method), run)
        finally:
            self.take_core_record()
            self.adopt_rows(run)

    def adopt_rows(self, run: "Run") -> None:
        """Copy the rows in use from the core after the last steps of a run."""
        if run.row_changes:
            self.rows = np.array(self.core.rows, int)

    def derivatives(self, t: Array, y: Array, guess: Array) -> tuple[Array, Array]:
        """See `mbdae.system.System`."""
        if len(t):
            self.determine_rank(float(t[0]), y[0])
        F, lam = self.core.derivatives(np.ascontiguousarray(t), np.ascontiguousarray(y))
        failed = np.isnan(F).any(axis=1) | np.isnan(lam).any(axis=1)
        F[failed], lam[failed] = super().derivatives(t[failed], y[failed], guess[failed])
        return F, lam

    def residuals(self, t: Array, y: Array) -> tuple[Array, Array, Array]:
        """See `Index2System.residuals`."""
        g, rates, energies, unknown = self.core.residuals(np.ascontiguousarray(t), np.ascontiguousarray(y))
        if unknown and (failed := np.isnan(energies).any(axis=1) & np.isfinite(y).all(axis=1)).any():
            g[failed], rates[failed], energies[failed] = super().residuals(t[failed], y[failed])
        return g, rates, energies

    def closure_residual(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        """Return g(t, q) and G v + g_t of all rows, (ng,) each; kinematics in Python are not updated."""
        y = np.concatenate([q, v, np.zeros(self.ns + 1)])
        g, rates, _, unknown = self.core.residuals(np.array([t], float), y[None])
        return self.residual(t, q, v) if unknown else (g[0], rates[0])

    def partials(
        self, t: float, q: Array, u: Array, vdot: Array, lam: Array, rows: Array, each: list[Array] | None = None
    ) -> EquationPartials:
        """See `Index2System.partials`; the core does not provide the partials of ``each`` law."""
        self.expand()
        if each is not None or self.closure_friction or not np.array_equal(rows, self.core.rows):
            return super().partials(t, q, u, vdot, lam, rows, each)
        all_lam = np.zeros(self.ng)
        all_lam[rows] = lam
        result = self.core.partials(t, q, u, vdot, all_lam)
        if result is None:
            return super().partials(t, q, u, vdot, lam, rows)
        M, K, D, G, B, g_t = result
        E, nv = np.eye(len(u)), self.nv
        E[:nv, :nv] = M
        L = np.vstack([G.T, np.zeros((len(u) - nv - 1, len(G))), -g_t])
        return EquationPartials(E, K, D, L, G, B)

    def rate_partials(self, t: float, q: Array, v: Array, rows: Array) -> tuple[Array, Array]:
        """See `Index2System.rate_partials`."""
        u = np.concatenate([v, np.zeros(self.ns + 1)])
        partials = self.partials(t, q, u, np.zeros(self.nv), np.zeros(len(rows)), rows)
        return partials.G, partials.B

    def take_core_record(self) -> None:
        """Add the core's counts to those of the system, and update its extremes."""
        *counts, least, g, rate, speed = self.core.take_record()
        self.counts.add(*counts)
        self.least_pivot_ratio = min(self.least_pivot_ratio, least)
        self.largest_g = max(self.largest_g, g)
        self.largest_rate = max(self.largest_rate, rate)
        self.largest_speed = max(self.largest_speed, speed)

    def rows_from_core(self) -> None:
        """Copy the rows in use from the core."""
        if self._rank_known and not self.rows_frozen:
            self.rows = np.array(self.core.rows, int)
        self._last_q = None

    def rows_to_core(self) -> None:
        """Copy the rows in use to the core."""
        rows = [] if self.rows is None else self.rows.tolist()
        self.core.use_rows(rows, len(rows), self.rank_threshold, self.rows_frozen)
        self._rank_known = True

    def project_state(self, t: float, y: Array, tight: bool = False) -> Array:
        """See `Index2System.project_state`."""
        projected = self.core.project_state(t, y, tight) if self._rank_known else None
        self.take_core_record()
        return super().project_state(t, y, tight) if projected is None else projected

    def rows_of_all_modes(self, t: float, q: Array, v: Array) -> tuple[Array, Array, Array, Array] | None:
        """See `Index2System.rows_of_all_modes`."""
        return self.core.rows_of_all_modes(t, q, v)

    def enter(self, mode: Mode) -> None:
        """See `Index2System.enter`."""
        if mode != self.mode:
            super().enter(mode)
            self._mode_to_core()
            self._rank_known = False

    def _mode_to_core(self) -> None:
        if not self.mechanism.switches:
            return
        inactive = self.constraints.inactive
        self.core.deactivate_rows([k in inactive for k in range(self.ng)], self.has_sticking_joints)
        for k, (law, _) in enumerate(self.laws.acting):
            if isinstance(law, KineticFrictionElement):
                self.core.change_law(k, law.core_data()["a"])

    def use_rows(self, rows: tuple[int, ...], frozen: bool = True) -> None:
        """See `mbdae.system.System`."""
        super().use_rows(rows, frozen)
        self.rows_to_core()

    def update_independent_rows(self, t: float, state: State) -> State:
        """See `mbdae.system.System`."""
        if self._rank_known and self.rows_frozen and (state.carry is None or self.core_carry(state) is not None):
            result = self.core.update_independent_rows(t, state.y, state.carry)
            self.take_core_record()
            if result is not None:
                changed, y, carry = result
                if changed:
                    self.rows = np.array(self.core.rows, int)
                    return State(y, carry, state.compensation)
                return state
        self.rows_from_core()
        state = super().update_independent_rows(t, state)
        self.rows_to_core()
        return state


class CompiledGGL(GGLSystem, CompiledSystem):
    """`GGLSystem` in the compiled core."""


class CompiledIndex1(Index1System, CompiledSystem):
    """`Index1System` in the compiled core."""

    def rate(self, t: float, y: Array) -> tuple[Array, Array]:
        """See `Index1System.rate`; `update_independent_rows` adds its counters after the step."""
        found = self.core.raw_derivative(t, y) if self._rank_known else None
        return super().rate(t, y) if found is None else found


FORMULATIONS: tuple[type[CompiledSystem], ...] = (CompiledSystem, CompiledGGL, CompiledIndex1)
COMPILED: dict[str, Callable[..., CompiledSystem]] = {c.formulation: c for c in FORMULATIONS}
