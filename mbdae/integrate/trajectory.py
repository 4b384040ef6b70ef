"""The steps of a run once more, and how they move: what tangents and adjoints of runs go along.

A run's nodes tell its steps: each leads from one node to the next with the size that was accepted. Where two nodes
stand at one time but for roundings there was a jump. Beside the nodes a trace keeps what the method carried at
some of them (`mbdae.integrate.checkpoints`), and where it was found anew; stages are computed again when they are asked
for.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np

from .. import backend
from ..errors import InputError, StepError
from ..mechanism.discrete_sensitivity.ggl_sensitivity import GGLSensitivity
from ..mechanism.discrete_sensitivity.index2_sensitivity import Index2Sensitivity
from ..mechanism.discrete_sensitivity.parameter_partials import Parameters
from ..methods import Method, Tableau, method_of
from ..methods.collocation_sensitivity import CollocationSensitivity
from ..methods.step_sensitivity import StepSensitivity
from ..solution.solution import Solution
from ..system import Array, State, System
from .carry_record import RecordedStates
from .checkpoints import Checkpoints
from .differentiable_runs import require_differentiable
from .jumps import MARGIN
from .native_trajectory import native_trajectory
from .steppers.adaptive import Adaptive
from .steppers.fixed import Fixed

JUMP = 6 * MARGIN  # roundings of t: nodes nearer than that stand before and after a jump
REPEATED = 1e-7  # of 1 + |y|: what a step that is repeated may differ from the one that was taken
SYNCHRONOUS = 1e-10  # of 1 + |y|: more than that, roundings have grown so far that the run's own point counts


class _RunView(NamedTuple):
    """What a stepper asks of a run to judge a projection."""

    system: System
    state: State


class LinearMap(NamedTuple):
    """A part of a run that is linear in (dy, dp), a matrix (ny, ny + k) of y, or of the carry."""

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


StepSensitivityPart = StepSensitivity | CollocationSensitivity
TrajectoryPart = StepSensitivityPart | LinearMap


class Trajectory:
    """A run of a half-explicit or a collocation method, to be gone along again.

    Args:
        sol: the run.
        parameters: numbers of its mechanism that vary.

    Attributes:
        ts: times of the nodes, (n,).
        ys: points there, (n, ...).
        given: the first point before controllers looked at it, and modes and projections moved it.
        system: a workspace, which runs with the same parameters share: each `hold` makes it this run's.
        slopes: what moves.
        n_carry: length of what the method carries.
        core: many steps at once in the compiled core, where it has them.

    Raises:
        InputError: for a run of another kind, or one whose steps cannot be repeated.
    """

    def __init__(self, sol: Solution, parameters: Parameters) -> None:
        mech, settings = require_differentiable(sol), sol.settings
        self.sol, self.project = sol, bool(settings.get("project"))
        self.tableau = cast(Method, method_of(settings))
        self.ts, self.ys, _ = (np.asarray(a) for a in sol.nodes)
        q, v, _ = np.split(self.ys[0], [mech.nq, mech.nq + mech.nv])
        own = {"q": q, "v": v, "s": list(mech.states.values())}  # of files that do not say
        self.given = np.concatenate([*(settings.get(name) or x for name, x in own.items()), [0.0]])
        formulation = settings["formulation"]
        stabilised = formulation == "ggl" and isinstance(self.tableau, Tableau)
        self.system: Any = parameters.workspace(formulation, None if stabilised else backend.load())
        self.mode = sol.mode(0) or self.system.mode
        self._enter(parameters)
        half_explicit = isinstance(self.tableau, Tableau) and not stabilised
        if self.system.sliding and not half_explicit:
            self.system.sliding.refuse(f"a gradient of {settings['method']!r} in {settings['formulation']!r}")
        if self.system.sliding.grips:
            self.system.sliding.refuse("a gradient of wheels that slide")
        self.slopes = (GGLSensitivity if stabilised else Index2Sensitivity)(self.system, parameters)
        self.controlled = "step" not in settings
        if self.controlled:
            self.stepper: Any = Adaptive(1, settings["rtol"], np.array(settings["atol"]), None, np.inf)
        else:
            self.stepper = Fixed(settings["step"], self.ts[0], self.ts[-1])
        self.changes = {i: rows for i, rows in sol.in_use}
        self.near = JUMP * float(np.spacing(max(abs(self.ts[0]), abs(self.ts[-1]), 1e-3)))
        self.jumped: list[bool] = (np.abs(np.diff(self.ts)) <= self.near).tolist()  # between nodes i and i + 1
        self.n_carry = self.slopes.width - self.system.nv if self.tableau.carries else 0
        self.renewed = np.zeros(len(self.ts), bool)
        self.checkpoints: Checkpoints | RecordedStates | None = None
        self.core = native_trajectory(self)
        if self.n_carry and sol.carried:
            self.checkpoints = RecordedStates(self.ys, sol.carried[0])
            self.renewed[sol.carried[1]] = True
        elif self.n_carry:
            self.hold(0)
            self.checkpoints = Checkpoints(
                len(self.ts), State(self.ys[0], self._restarted_carry(0, self.ys[0])), self._walk
            )

    def hold(self, i: int) -> None:
        """Let the workspace solve for the rows that were in use at node i."""
        self._enter(self.slopes.parameters)
        rows = next((rows for first, rows in reversed(self.sol.in_use) if first <= i), None)
        if rows and rows != self.system.in_use:
            self.system.hold(rows)

    def _enter(self, parameters: Parameters) -> None:
        """Let the workspaces be in the mode of the run."""
        if self.system.mode != self.mode:
            self.system.enter(self.mode)
        parameters.enter(self.mode)

    def state(self, i: int) -> State:
        """Where the step from node i starts."""
        return State(self.ys[i], self.checkpoints[i].carry if self.checkpoints else None)

    def start(self) -> Iterator[TrajectoryPart]:
        """What leads from a given start to the first node."""
        self.hold(0)
        t, y = float(self.ts[0]), self.given
        if len(self.system.mechanism.states):
            yield LinearMap(self.slopes.jumped(t, y), False)
            y = self.system.jump(t, y)
        if self.system.mechanism.switches:
            y, struck = self.at_start("struck", lambda: self.slopes.struck(t, y))
            yield LinearMap(struck, False)
        if self.project:
            yield LinearMap(self.at_start("restored", lambda: self.slopes.restored(t, y)), False)
        if self.project and (y != self.ys[0]).any():  # runs beside it may take one Gauss-Newton step more
            yield LinearMap(self.at_start("closed", lambda: self.slopes.restored(t, self.ys[0])), False)
        if self.n_carry:
            yield LinearMap(self.at_start("renewal", lambda: self.slopes.renewed(t, self.ys[0])), True)

    def at_start(self, name: str, find: Callable[[], Any]) -> Any:
        """Slopes at the first node, found once for runs from one start with the same parameters."""
        s = self.system
        key = type(s), s.in_use, self.ts[0], self.ys[0].tobytes(), self.given.tobytes()
        return self.slopes.parameters.once(name, key, find)

    def parts(self, i: int) -> Iterator[TrajectoryPart]:
        """What leads from node i to the next one, each part with the slopes where it was."""
        self.hold(i)
        t, t1, y, y1 = float(self.ts[i]), float(self.ts[i + 1]), self.ys[i], self.ys[i + 1]
        if self.jumped[i]:
            yield LinearMap(self.slopes.jumped(t1, y), False)
            y = self.system.jump(t1, y)
        else:
            for part in self.steps(i, t1 - t):
                yield part
                y = part.state.y
            if self.project:
                yield LinearMap(self.slopes.restored(t1, y), False)
                y = self.system.restore(t1, y)
                if self.renewed[i + 1]:
                    yield from self._renewal(t1, y)
        if i + 1 in self.changes:
            self.hold(i + 1)
            yield LinearMap(self.slopes.settled(t1, y), False)
        if i + 1 in self.changes or self.jumped[i]:
            yield from self._renewal(t1, y1)

    def carry_restart_parts(self, i: int) -> Iterator[TrajectoryPart]:
        """What follows behind a step to node i and its projection, where nothing else leads there."""
        if self.renewed[i]:
            self.hold(i)
            yield from self._renewal(float(self.ts[i]), self.ys[i])

    def steps(self, i: int, h: float) -> list[StepSensitivityPart]:
        """The step of size h from node i; two half ones where the method has no error estimate of its own."""
        t, state = float(self.ts[i]), self.state(i)
        at = self.system, self.slopes
        self.hold(i)  # which a segment that was walked again may have changed
        try:
            if not self.halved:
                return [self.tableau.slopes(*at, t, h, state)]
            first = self.tableau.slopes(*at, t, h / 2, state)
            return [first, self.tableau.slopes(*at, t + h / 2, h / 2, first.state)]
        except StepError as e:
            raise InputError(f"the step from t = {t:.9g} s cannot be repeated: {e}") from None

    def short(self, i: int, h: float) -> tuple[Array, list[TrajectoryPart]]:
        """The point (n,) where a step of size h from node i ends, brought back where the run is, and its parts."""
        steps = self.steps(i, h)
        y, t = steps[-1].state.y, float(self.ts[i]) + h
        if not self.project:
            return y, list(steps)
        return self.system.restore(t, y), [*steps, LinearMap(self.slopes.restored(t, y), False)]

    def between(self, i: int, t: float) -> Array:
        """The point (n,) where a shorter step from node i ends."""
        start = self.state(i)
        self.hold(i)
        y = self._taken(float(self.ts[i]), t - float(self.ts[i]), start).y
        return self.system.restore(t, y) if self.project else y

    @property
    def halved(self) -> bool:
        """Whether a step is two of half the size."""
        return self.controlled and not self.tableau.b_embedded

    def _renewal(self, t: float, y: Array) -> Iterator[TrajectoryPart]:
        if self.n_carry:
            yield LinearMap(self.slopes.renewed(t, y), True)

    def _walk(self, i: int, j: int, state: State) -> list[State]:
        """The states at nodes i, ..., j."""
        states = [state]
        while i < j:
            if self.core and (found := self.core.walk(i, j, states[-1], (REPEATED, SYNCHRONOUS))):
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
        """Find what the method carried at node i + 1, and see that the step is that of the run.

        Points and what is carried go on together, as in the run: where it is stiff, roundings in one that the other
        does not share grow from step to step.
        """
        self.hold(i)
        y1 = self.ys[i + 1]
        if not self.jumped[i]:
            state, self.renewed[i + 1] = self._repeat(i, state)
            apart = np.abs(self.system.difference(state.y, y1)).max()
            if not apart <= REPEATED * (1 + np.abs(y1).max()) and i + 1 not in self.changes:
                raise InputError(self._mismatch(i))
            if not apart <= SYNCHRONOUS * (1 + np.abs(y1).max()):
                state = State(y1, state.carry)
        if self.jumped[i] or i + 1 in self.changes:
            self.hold(i + 1)
            return State(y1, self._restarted_carry(i + 1, y1))
        return state

    def _restarted_carry(self, i: int, y: Array) -> Any:
        return self.system.carry(*self.system.derivative(float(self.ts[i]), y))

    def _repeat(self, i: int, start: State) -> tuple[State, bool]:
        """Take the step from node i once more; return where it ends, and whether what is carried is new."""
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
        """Where a step ends."""
        if not self.halved:
            return self.tableau.step(self.system, t, h, start).state
        half = self.tableau.step(self.system, t, h / 2, start)
        return self.tableau.step(self.system, t + h / 2, h / 2, half.state).state

    def _mismatch(self, i: int) -> str:
        where = f"the step from t = {self.ts[i]:.9g} s cannot be repeated"
        return f"{where}: not a step of the method, or one with other forces"
