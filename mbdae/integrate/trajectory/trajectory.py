"""Trajectory of a run: its steps are recomputed for discrete tangents and adjoints.

The nodes of a run define its steps: each step leads from one node to the next, with the accepted size. Two nodes at the
same time, or with the same q at times that differ by rounding, are a jump. Besides the nodes, a trajectory stores the
carries of the method at some nodes (`mbdae.integrate.trajectory.checkpoints`), and the nodes where the carry was
restarted; stages are recomputed on demand.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np

from ... import backend
from ...errors import InputError, StepError
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.discrete_sensitivity.point_sensitivity import PointSensitivity
from ...mechanism.formulations.friction_interface import smallest_slip
from ...methods import method_from_settings
from ...methods.runge_kutta import RungeKutta
from ...solution.sampling import set_slip_directions
from ...solution.solution import Solution
from ...system import Array, State, System
from ...tolerances import AGREEMENT, SAME_STATE
from ..events.jumps import LATE
from ..steppers.adaptive import Adaptive
from ..steppers.fixed import Fixed
from .checkpoints import Checkpoints, RecordedStates
from .differentiable_runs import require_differentiable
from .jump import ModeJumps
from .native_trajectory import NativeStep, NativeTrajectory
from .reset_jump import ResetJumps


class _RunView(NamedTuple):
    """The data of a run that a stepper needs to compare a projection with its tolerance."""

    system: System
    state: State


class LinearMap(NamedTuple):
    """Partials of a map with respect to (y, p): a matrix (ny, ny + k) for a map of y, or (nc, ny + k) for the carry."""

    matrix: Array
    maps_carry: bool

    def forward(self, dy: Array, carry: Array, dp: Array) -> tuple[Array, Array]:
        """Return the tangents of y and of the carry."""
        tangent = self.matrix @ np.concatenate([dy, dp])
        return (dy, tangent) if self.maps_carry else (tangent, carry)

    def reverse(self, y: Array, carry: Array) -> tuple[Array, Array, Array]:
        """Return the cotangents of y, of the carry and of the parameters."""
        cotangent = self.matrix.T @ (carry if self.maps_carry else y)
        y_bar, p_bar = cotangent[: len(y)], cotangent[len(y) :]
        return (y + y_bar, np.zeros_like(carry), p_bar) if self.maps_carry else (y_bar, carry, p_bar)


TrajectoryPart = NativeStep | LinearMap


class Trajectory:
    """A run of a half-explicit or a collocation method, recomputed on demand.

    Args:
        sol: the run.
        parameters: the varied parameters of its mechanism.

    Attributes:
        ts: times of the nodes, (n,).
        ys: points at the nodes, (n, ...).
        initial_point: the point at the start, before controllers, mode selection and projection change it.
        system: a workspace, shared by runs with the same parameters; `enter_node` sets its mode and rows in use.
        sensitivity: discrete sensitivity of the maps other than steps.
        n_carry: length of the carry.
        core: the steps in the compiled core.

    Raises:
        InputError: for an unsupported run, for a run whose steps cannot be repeated, and without the core.
    """

    def __init__(self, sol: Solution, parameters: Parameters) -> None:
        mech, settings = require_differentiable(sol), sol.settings
        self.sol, self.project = sol, bool(settings.get("project"))
        self.tableau = cast(RungeKutta, method_from_settings(settings))
        self.ts, self.ys, _ = (np.asarray(a) for a in sol.nodes)
        q, v, _ = np.split(self.ys[0], [mech.nq, mech.nq + mech.nv])
        defaults = {"q": q, "v": v, "s": list(mech.states.values())}  # for files without these settings
        self.initial_point = np.concatenate([*(settings.get(name) or x for name, x in defaults.items()), [0.0]])
        self.system: Any = parameters.workspace(settings["formulation"], backend.load())
        self.system.set_min_slip_speed(smallest_slip(mech, 0.0))
        self._enter(0, parameters)
        self.controlled = "step" not in settings
        if self.controlled:
            self.stepper: Any = Adaptive(1, settings["rtol"], np.array(settings["atol"]), None, np.inf)
        else:
            self.stepper = Fixed(settings["step"], self.ts[0], self.ts[-1])
        self.changes = {i: rows for i, rows in sol.in_use}
        self.jumped: list[bool] = sol.jumped().tolist()
        self.core = NativeTrajectory(self, parameters)
        self.sensitivity = PointSensitivity(self.system, parameters, self.core.parameters)
        self.jumps, self.resets = ModeJumps(self), ResetJumps(self)
        self.n_carry = self.sensitivity.n_carry if self.tableau.carries else 0
        self.restarted = np.zeros(len(self.ts), bool)
        self.checkpoints: Checkpoints | RecordedStates | None = None
        if self.n_carry and sol.carried:
            self.checkpoints = RecordedStates(self.ys, sol.carried[0])
            self.restarted[sol.carried[1]] = True
        elif self.n_carry:
            self.enter_node(0)
            start = State(self.ys[0], self._restarted_carry(0, self.ys[0]))
            self.checkpoints = Checkpoints(len(self.ts), start, self._recompute)

    def enter_node(self, i: int) -> None:
        """Use the mode and the rows that were in use at node i."""
        self._enter(i, self.core.varied)
        rows = next((rows for first, rows in reversed(self.sol.in_use) if first <= i), None)
        if rows and rows != self.system.in_use:
            self.system.use_rows(rows)
        self.system.determine_rank(float(self.ts[i]), self.ys[i])

    def _enter(self, i: int, parameters: Parameters) -> None:
        """Enter the mode of node i in the workspaces."""
        mode = self.sol.mode(i) or self.system.mode
        if self.system.mode != mode:
            self.system.enter(mode)
        parameters.enter(mode)
        if self.system.closure_friction.can_stick:
            self._set_slip_directions(i, parameters)
        if hasattr(self, "sensitivity"):
            self.sensitivity.native = self.core.enter_mode()

    def _set_slip_directions(self, i: int, parameters: Parameters) -> None:
        """Set the directions of exact sliding friction in the mode of node i; within a mode they are constant.

        Raises:
            InputError: for slip with several components, whose direction varies.
        """
        friction = self.system.closure_friction
        friction.reject_planar_slips("the run")
        starts = [first for first, _ in self.sol.modes]
        k = bisect_right(starts, i)
        last = starts[k] if k < len(starts) else len(self.ys)
        set_slip_directions(self.system, self.ys[starts[k - 1] : last])
        for other in (parameters.system, *(s for systems in parameters.perturbed_systems for s in systems.values())):
            other.closure_friction.slip_directions[:] = friction.slip_directions

    def state(self, i: int) -> State:
        """Return the state at which the step from node i starts."""
        return State(self.ys[i], self.checkpoints[i].carry if self.checkpoints else None)

    def start_parts(self) -> Iterator[TrajectoryPart]:
        """Yield the maps from the initial point to the first node."""
        self.enter_node(0)
        t, y = float(self.ts[0]), self.initial_point
        if len(self.system.mechanism.states):
            yield LinearMap(self.sensitivity.jump(t, y, LATE), False)
            y = self.system.jump(t, y, LATE)
        if self.system.mechanism.switches:
            y, impact = self.at_start("initial impact", lambda: self.jumps.at_start(t, y))
            yield LinearMap(impact, False)
            y, impact = self.at_start("initial rows", lambda: self.sensitivity.initial_impact(t, y))
            yield LinearMap(impact, False)
        if self.project:
            yield LinearMap(self.at_start("projection", lambda: self.sensitivity.projection(t, y)), False)
        if self.project and (y != self.ys[0]).any():  # a perturbed start may need another Gauss-Newton step
            yield LinearMap(self.at_start("projection 2", lambda: self.sensitivity.projection(t, self.ys[0])), False)
        if self.n_carry:
            yield LinearMap(self.at_start("carry", lambda: self.sensitivity.restarted_carry(t, self.ys[0])), True)

    def at_start(self, name: str, find: Callable[[], Any]) -> Any:
        """Return partials at the first node, computed once for runs with the same start and parameters."""
        s = self.system
        key = type(s), s.in_use, self.ts[0], self.ys[0].tobytes(), self.initial_point.tobytes()
        return self.sensitivity.parameters.cached(name, key, find)

    def step_parts(self, i: int) -> Iterator[TrajectoryPart]:
        """Yield the maps from node i to the next one."""
        self.enter_node(i)
        t1, y1, changed = float(self.ts[i + 1]), self.ys[i + 1], i + 1 in self.changes
        switched = self.jumped[i] and self.system.mechanism.switches
        if jumps := self.resets if i in self.resets else self.jumps if switched else None:
            yield LinearMap(jumps[i].matrix, False)
            self.enter_node(i + 1)
            yield from self._carry_restart(t1, y1)
            return
        if self.jumped[i]:
            yield LinearMap(self.sensitivity.jump(t1, self.ys[i]), False)
        else:
            yield NativeStep(self.core, i)
        if changed:
            y = self.system.jump(t1, self.ys[i]) if self.jumped[i] else self.point_after(i, t1)
            self.enter_node(i + 1)
            yield LinearMap(self.sensitivity.row_update(t1, y), False)
        if changed or self.jumped[i] or self.restarted[i + 1]:
            yield from self._carry_restart(t1, y1)

    def carry_restart_parts(self, i: int) -> Iterator[TrajectoryPart]:
        """Yield the map that restarts the carry at node i after a step and its projection, if it was restarted."""
        if self.restarted[i]:
            self.enter_node(i)
            yield from self._carry_restart(float(self.ts[i]), self.ys[i])

    def point_after(self, i: int, t: float) -> Array:
        """Return the point (n,) after a shorter step from node i."""
        start = self.state(i)
        self.enter_node(i)
        y = self._end_of_step(float(self.ts[i]), t - float(self.ts[i]), start).y
        return self.system.project_state(t, y) if self.project else y

    @property
    def uses_half_steps(self) -> bool:
        """Whether a step consists of two half steps."""
        return self.controlled and not self.tableau.b_embedded

    def _carry_restart(self, t: float, y: Array) -> Iterator[TrajectoryPart]:
        if self.n_carry:
            yield LinearMap(self.sensitivity.restarted_carry(t, y), True)

    def _recompute(self, i: int, j: int, state: State) -> list[State]:
        """Return the states at nodes i, ..., j."""
        states = [state]
        while i < j:
            if self.core and (recomputed := self.core.recompute(i, j, states[-1], (SAME_STATE, AGREEMENT))):
                states += recomputed.states
                self.restarted[i + 1 : i + 1 + len(recomputed.states)] = recomputed.restarted
                i += len(recomputed.states)
                if not recomputed.complete:
                    raise InputError(self._mismatch(i))
                continue
            states.append(self._advance(i, states[-1]))
            i += 1
        return states

    def _advance(self, i: int, state: State) -> State:
        """Return the state at node i + 1 with its carry, and check that the step reproduces the point of the run.

        Points and carries are recomputed together, as in the run: in stiff runs, rounding errors in only one of them
        would grow from step to step.
        """
        self.enter_node(i)
        y1 = self.ys[i + 1]
        if not self.jumped[i]:
            state, self.restarted[i + 1] = self._repeat(i, state)
            error = np.abs(self.system.difference(state.y, y1)).max()
            if not error <= SAME_STATE * (1 + np.abs(y1).max()) and i + 1 not in self.changes:
                raise InputError(self._mismatch(i))
            if not error <= AGREEMENT * (1 + np.abs(y1).max()):
                state = State(y1, state.carry)
        if self.jumped[i] or i + 1 in self.changes:
            self.enter_node(i + 1)
            return State(y1, self._restarted_carry(i + 1, y1))
        return state

    def _restarted_carry(self, i: int, y: Array) -> Any:
        return self.system.carry(*self.system.derivative(float(self.ts[i]), y))

    def repeat_between(self, t0: float, t1: float) -> None:
        """Repeat each step between two nodes.

        Raises:
            InputError: if a step fails, with the reason.
        """
        first, last = sorted((t0, t1))
        for i in np.flatnonzero((self.ts[:-1] >= first) & (self.ts[1:] <= last)).tolist():
            self._repeat(i, State(self.ys[i], self._restarted_carry(i, self.ys[i])))

    def _repeat(self, i: int, start: State) -> tuple[State, bool]:
        """Repeat the step from node i; return its end, and whether the carry was restarted."""
        t, h = float(self.ts[i]), float(self.ts[i + 1] - self.ts[i])
        try:
            state = self._end_of_step(t, h, start)
            if not self.project:
                return State(state.y, state.carry), False
            projected, view = self.system.project_state(t + h, state.y), _RunView(self.system, start)
            if self.stepper.tolerates(view, projected, self.system.difference(state.y, projected)):
                return State(projected, state.carry), False
            return State(projected, self._restarted_carry(i + 1, projected)), True
        except StepError as e:
            raise InputError(f"the step from t = {t:.9g} s cannot be repeated: {e}") from None

    def _end_of_step(self, t: float, h: float, start: State) -> State:
        """Return the end of a step."""
        if not self.uses_half_steps:
            return self.tableau.step(self.system, t, h, start).state
        half = self.tableau.step(self.system, t, h / 2, start)
        return self.tableau.step(self.system, t + h / 2, h / 2, half.state).state

    def _mismatch(self, i: int) -> str:
        where = f"the step from t = {self.ts[i]:.9g} s cannot be repeated"
        return f"{where}: not a step of the method, or one with other forces"
