"""Recompute the steps of a run for its discrete tangent and adjoint.

The nodes of a run define its steps: each leads from one node to the next with the accepted size. Two nodes at one time,
up to rounding, are a jump. Besides the nodes, a trajectory keeps the carries of the method at some of them
(`mbdae.integrate.checkpoints`), and where they were restarted; stages are recomputed on demand.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np

from .. import backend
from ..errors import InputError, StepError
from ..mechanism.discrete_sensitivity.parameter_partials import Parameters
from ..mechanism.discrete_sensitivity.point_sensitivity import PointSensitivity
from ..methods import Method, method_of
from ..solution.solution import Solution
from ..system import Array, State, System
from ..tolerances import AGREEMENT, NEGLIGIBLE, SAME_STATE
from .carry_record import RecordedStates
from .checkpoints import Checkpoints
from .differentiable_runs import require_differentiable
from .events.jumps import MARGIN
from .native_trajectory import NativeStep, NativeTrajectory
from .steppers.adaptive import Adaptive
from .steppers.fixed import Fixed

JUMP = 6 * MARGIN  # roundings of t: closer nodes are the two sides of a jump


class _RunView(NamedTuple):
    """View of a run with the data that a stepper needs to assess a projection."""

    system: System
    state: State


class LinearMap(NamedTuple):
    """Part of a run that is linear in (dy, dp), a matrix (ny, ny + k) of y, or of the carry."""

    matrix: Array
    maps_carry: bool

    def forward(self, dy: Array, carry: Array, dp: Array) -> tuple[Array, Array]:
        """Return the variations of y and of the carry."""
        found = self.matrix @ np.concatenate([dy, dp])
        return (dy, found) if self.maps_carry else (found, carry)

    def reverse(self, y: Array, carry: Array) -> tuple[Array, Array, Array]:
        """Return the cotangents of y, of the carry and of the parameters."""
        back = self.matrix.T @ (carry if self.maps_carry else y)
        ny = len(y)
        return (y + back[:ny], np.zeros_like(carry), back[ny:]) if self.maps_carry else (back[:ny], carry, back[ny:])


TrajectoryPart = NativeStep | LinearMap


class Trajectory:
    """A run of a half-explicit or a collocation method, recomputed on demand.

    Args:
        sol: the run.
        parameters: the varied parameters of its mechanism.

    Attributes:
        ts: times of the nodes, (n,).
        ys: points there, (n, ...).
        given: the first point before controllers, modes and projections changed it.
        system: a workspace, shared by runs with the same parameters: each `enter_node` prepares it for this run.
        sensitivity: discrete sensitivity of the maps.
        n_carry: length of the carry.
        core: its steps in the compiled core.

    Raises:
        InputError: for an unsupported run, one whose steps cannot be repeated, and without the core.
    """

    def __init__(self, sol: Solution, parameters: Parameters) -> None:
        mech, settings = require_differentiable(sol), sol.settings
        self.sol, self.project = sol, bool(settings.get("project"))
        self.tableau = cast(Method, method_of(settings))
        self.ts, self.ys, _ = (np.asarray(a) for a in sol.nodes)
        q, v, _ = np.split(self.ys[0], [mech.nq, mech.nq + mech.nv])
        own = {"q": q, "v": v, "s": list(mech.states.values())}  # of files that do not specify them
        self.given = np.concatenate([*(settings.get(name) or x for name, x in own.items()), [0.0]])
        self.system: Any = parameters.workspace(settings["formulation"], backend.load())
        self.mode = sol.mode(0) or self.system.mode
        self._enter(parameters)
        if self.system.sliding.can_stick:
            self.system.sliding.reject("a gradient of wheels that slide")
        self.controlled = "step" not in settings
        if self.controlled:
            self.stepper: Any = Adaptive(1, settings["rtol"], np.array(settings["atol"]), None, np.inf)
        else:
            self.stepper = Fixed(settings["step"], self.ts[0], self.ts[-1])
        self.changes = {i: rows for i, rows in sol.in_use}
        self.near = JUMP * float(np.spacing(max(abs(self.ts[0]), abs(self.ts[-1]), NEGLIGIBLE)))
        self.jumped: list[bool] = (np.abs(np.diff(self.ts)) <= self.near).tolist()  # between nodes i and i + 1
        self.core = NativeTrajectory(self, parameters)
        self.sensitivity = PointSensitivity(self.system, parameters, self.core.parameters)
        self.n_carry = self.sensitivity.n_carry if self.tableau.carries else 0
        self.renewed = np.zeros(len(self.ts), bool)
        self.checkpoints: Checkpoints | RecordedStates | None = None
        if self.n_carry and sol.carried:
            self.checkpoints = RecordedStates(self.ys, sol.carried[0])
            self.renewed[sol.carried[1]] = True
        elif self.n_carry:
            self.enter_node(0)
            self.checkpoints = Checkpoints(
                len(self.ts), State(self.ys[0], self._restarted_carry(0, self.ys[0])), self._recompute
            )

    def enter_node(self, i: int) -> None:
        """Use the rows that were in use at node i."""
        self._enter(self.core.of)
        rows = next((rows for first, rows in reversed(self.sol.in_use) if first <= i), None)
        if rows and rows != self.system.in_use:
            self.system.use_rows(rows)
        self.system.begin(float(self.ts[i]), self.ys[i])

    def _enter(self, parameters: Parameters) -> None:
        """Enter the mode of the run in the workspaces."""
        if self.system.mode != self.mode:
            self.system.enter(self.mode)
        parameters.enter(self.mode)

    def state(self, i: int) -> State:
        """Return the state at which the step from node i starts."""
        return State(self.ys[i], self.checkpoints[i].carry if self.checkpoints else None)

    def start(self) -> Iterator[TrajectoryPart]:
        """Yield the maps from a given start to the first node."""
        self.enter_node(0)
        t, y = float(self.ts[0]), self.given
        if len(self.system.mechanism.states):
            yield LinearMap(self.sensitivity.jumped(t, y), False)
            y = self.system.jump(t, y)
        if self.system.mechanism.switches:
            y, impact = self.at_start("initial impact", lambda: self.sensitivity.initial_impact(t, y))
            yield LinearMap(impact, False)
        if self.project:
            yield LinearMap(self.at_start("restored", lambda: self.sensitivity.restored(t, y)), False)
        if self.project and (y != self.ys[0]).any():  # runs from a perturbed start may take another Gauss-Newton step
            yield LinearMap(self.at_start("closed", lambda: self.sensitivity.restored(t, self.ys[0])), False)
        if self.n_carry:
            yield LinearMap(self.at_start("renewal", lambda: self.sensitivity.renewed(t, self.ys[0])), True)

    def at_start(self, name: str, find: Callable[[], Any]) -> Any:
        """Return partials at the first node, computed once for runs from one start with the same parameters."""
        s = self.system
        key = type(s), s.in_use, self.ts[0], self.ys[0].tobytes(), self.given.tobytes()
        return self.sensitivity.parameters.once(name, key, find)

    def step_parts(self, i: int) -> Iterator[TrajectoryPart]:
        """Yield the maps from node i to the next one."""
        self.enter_node(i)
        t1, y1, changed = float(self.ts[i + 1]), self.ys[i + 1], i + 1 in self.changes
        if self.jumped[i]:
            yield LinearMap(self.sensitivity.jumped(t1, self.ys[i]), False)
        else:
            yield NativeStep(self.core, i)
        if changed:
            y = self.system.jump(t1, self.ys[i]) if self.jumped[i] else self.between(i, t1)
            self.enter_node(i + 1)
            yield LinearMap(self.sensitivity.row_update(t1, y), False)
        if changed or self.jumped[i] or self.renewed[i + 1]:
            yield from self._renewal(t1, y1)

    def carry_restart_parts(self, i: int) -> Iterator[TrajectoryPart]:
        """Yield the maps after a step to node i and its projection, which restart the carry."""
        if self.renewed[i]:
            self.enter_node(i)
            yield from self._renewal(float(self.ts[i]), self.ys[i])

    def between(self, i: int, t: float) -> Array:
        """Return the point (n,) after a shorter step from node i."""
        start = self.state(i)
        self.enter_node(i)
        y = self._taken(float(self.ts[i]), t - float(self.ts[i]), start).y
        return self.system.restore(t, y) if self.project else y

    @property
    def halved(self) -> bool:
        """Whether a step consists of two half steps."""
        return self.controlled and not self.tableau.b_embedded

    def _renewal(self, t: float, y: Array) -> Iterator[TrajectoryPart]:
        if self.n_carry:
            yield LinearMap(self.sensitivity.renewed(t, y), True)

    def _recompute(self, i: int, j: int, state: State) -> list[State]:
        """Return the states at nodes i, ..., j."""
        states = [state]
        while i < j:
            if self.core and (found := self.core.recompute(i, j, states[-1], (SAME_STATE, AGREEMENT))):
                states += found.states
                self.renewed[i + 1 : i + 1 + len(found.states)] = found.renewed
                i += len(found.states)
                if not found.complete:
                    raise InputError(self._mismatch(i))
                continue
            states.append(self._advance(i, states[-1]))
            i += 1
        return states

    def _advance(self, i: int, state: State) -> State:
        """Return the state at node i + 1 with its carry, and check that the step reproduces that of the run.

        Points and carries are recomputed together, as in the run: in stiff runs, rounding errors that only one of them
        contains would grow from step to step.
        """
        self.enter_node(i)
        y1 = self.ys[i + 1]
        if not self.jumped[i]:
            state, self.renewed[i + 1] = self._repeat(i, state)
            apart = np.abs(self.system.difference(state.y, y1)).max()
            if not apart <= SAME_STATE * (1 + np.abs(y1).max()) and i + 1 not in self.changes:
                raise InputError(self._mismatch(i))
            if not apart <= AGREEMENT * (1 + np.abs(y1).max()):
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
            InputError: if that fails, with the reason.
        """
        first, last = sorted((t0, t1))
        for i in np.flatnonzero((self.ts[:-1] >= first) & (self.ts[1:] <= last)).tolist():
            self._repeat(i, State(self.ys[i], self._restarted_carry(i, self.ys[i])))

    def _repeat(self, i: int, start: State) -> tuple[State, bool]:
        """Repeat the step from node i; return its end, and whether the carry was restarted."""
        t, h = float(self.ts[i]), float(self.ts[i + 1] - self.ts[i])
        try:
            state = self._taken(t, h, start)
            if not self.project:
                return State(state.y, state.carry), False
            closed, standing = self.system.restore(t + h, state.y), _RunView(self.system, start)
            if self.stepper.tolerates(standing, closed, self.system.difference(state.y, closed)):
                return State(closed, state.carry), False
            return State(closed, self._restarted_carry(i + 1, closed)), True
        except StepError as e:
            raise InputError(f"the step from t = {t:.9g} s cannot be repeated: {e}") from None

    def _taken(self, t: float, h: float, start: State) -> State:
        """Return the end of a step."""
        if not self.halved:
            return self.tableau.step(self.system, t, h, start).state
        half = self.tableau.step(self.system, t, h / 2, start)
        return self.tableau.step(self.system, t + h / 2, h / 2, half.state).state

    def _mismatch(self, i: int) -> str:
        where = f"the step from t = {self.ts[i]:.9g} s cannot be repeated"
        return f"{where}: not a step of the method, or one with other forces"
