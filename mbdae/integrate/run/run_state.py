"""State of a run, and its record of nodes."""

from collections.abc import Sequence
from contextlib import suppress
from math import ulp
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ...errors import StepError
from ...mechanism import Mechanism
from ...mechanism.formulations.index2 import Index2System
from ...solution.solution import Problem, Solution
from ...system import Array, State, Step, System
from ...tolerances import JUMP_MARGIN
from ..events.driver_checks import DriverChecks
from ..events.jumps import Jumps, SmoothInterval
from ..events.mode_changes import ModeChanges
from ..events.resets import Resets
from ..events.singularity import SingularityMonitor
from ..events.source import EventSource, Occurrence
from ..events.user_events import UserEvents
from ..options.options import RunOptions
from .carry_record import CarryRecord
from .growing_array import GrowingArray
from .stiffness_detection import StiffnessDetector

if TYPE_CHECKING:
    from ..steppers.adaptive import Adaptive
    from ..steppers.stepper import Stepper
    from .backward_steps import BackwardStepper
    from .step_map import StepMap

SOURCES: tuple[type[EventSource], ...] = (
    DriverChecks, ModeChanges, SingularityMonitor, StiffnessDetector, UserEvents, Resets, Jumps
)  # fmt: skip
"""Sources of events, in the order in which they check a step."""


class RunState:
    """State and record of a run.

    A smooth interval lies between two discontinuities of the right-hand side or of the state: jumps, impacts and mode
    changes. Each discontinuity adds a second node at the same time, up to rounding.
    """

    def __init__(
        self,
        problem: Problem,
        options: RunOptions,
        system: System,
        stepper: "Stepper",
        start: Array,
        kinds: Sequence[type[EventSource]] = SOURCES,
    ) -> None:
        self.problem, self.options, self.tableau, self.project = problem, options, options.method, options.project
        self.t, self.t1, self.sign, self.discontinuities = options.t0, options.end, options.sign, 0
        self.continues = self.restarted = False  # see `continue_to`; carry restarted by a projection
        self.system, self.stepper, self.state = system, stepper, State(start)
        self.mechanism_system = cast(Index2System, system) if isinstance(problem, Mechanism) else None  # the workspace
        self.control: Adaptive | None = None if options.formulation == "index1" else stepper.control  # None: baseline
        self.interval = SmoothInterval(self.t1, self.t1, None)  # corrected when the run begins
        self.rejected: int | None = 0
        self.undone_motion: Array | None = None  # motion since a projection undid a step, see `projected_step`
        self.initial_point = start.copy()  # before controllers are sampled, see `point_before_sampling`
        self.ts, self.ys, self.zs = [self.t], GrowingArray(start), GrowingArray(np.full(system.nz, np.nan))
        self.in_use: list[tuple[int, tuple[int, ...]]] = []  # first node of each set of rows in use
        self.carries = CarryRecord()
        self.backward_stepper: BackwardStepper | None = None
        self.settings = options.record()  # recorded with the solution
        self.fallback = ""  # why the run cannot use the compiled core
        self._partial_solution: Solution | None = None
        self.add_sources(kinds)

    def add_sources(self, kinds: Sequence[type[EventSource]] = SOURCES) -> None:
        """Add the sources of events.

        Raises:
            InputError: for options that a source does not support.
        """
        created: Any = {kind: source for kind in kinds if (source := kind.from_run(self))}
        self.sources: tuple[EventSource, ...] = tuple(source for source in created.values() if source.is_needed)
        self.mode_changes: ModeChanges = created.get(ModeChanges)
        self.singularity_monitor: SingularityMonitor = created.get(SingularityMonitor)
        self.user_events: UserEvents = created.get(UserEvents)
        self.jumps: Jumps = created.get(Jumps)

    def begin(self, ahead: bool = False, jumps: bool = True) -> None:
        """Begin a smooth interval at the last node: adjust the point, and compute its derivative and the carry.

        Args:
            ahead: whether the stepper may already take the first steps, which it records when it advances.
            jumps: whether controllers with a sampling instant at this time are still to be sampled.
        """
        y = self.ys[-1].copy()
        for source in reversed(self.sources):  # states jump before mode selection
            if jumps or source is not self.jumps:
                y = source.adjust_point(self, y)
        self.interval = self.jumps.interval(self.t)
        if self.in_use:
            self._start_at(y)
        else:
            self.set_start(*self.stepper.begin_run(self, y, ahead))
        for source in self.sources:
            source.begin_interval(self)

    def point_before_sampling(self) -> Array:
        """Return the initial point, with the states that controllers had before they were sampled."""
        out, first = self.ys[-1].copy(), -1 - self.system.ns  # type: ignore[attr-defined]
        out[first:-1] = self.initial_point[first:-1]
        return out

    def _start_at(self, y: Array, restarted: bool = False) -> None:
        y = self.system.update_independent_rows(self.t, State(y)).y
        self.set_start(y, *self.system.derivative(self.t, y), restarted)

    def set_start(self, y: Array, F: Array, z: Array, restarted: bool = False) -> None:
        """Set y, y' (ny,) and z (nz,) at the last node, where a smooth interval begins."""
        self.record_rows(restarted)
        self.ys[-1], self.zs[-1], self.F = y, z, F
        self.state = State(y, self.system.carry(F, z))
        self.carries.store(len(self.ts) - 1, self.state.carry)

    def record_rows(self, restarted: bool = False) -> None:
        """Record the rows in use from the last node on, if they have changed."""
        rows = self.system.in_use
        if restarted or not self.in_use or self.in_use[-1][1] != rows:
            self.in_use.append((len(self.ts) - 1, rows))

    def restart_after_jump(self, t: float, exact_end: bool = False, jumps: bool = True) -> None:
        """Begin the next smooth interval after a jump, at time t: a second node, just after the previous one.

        Args:
            t: time of the jump.
            exact_end: whether the previous node is also at t: its time is moved to just before the jump.
            jumps: see `begin`.
        """
        self.end_interval(len(self.ts) - 1)
        if exact_end:
            self.ts[-1] -= JUMP_MARGIN * ulp(t)
        self._append(t, self.ys[-1], self.zs[-1])
        self.t = t
        self.begin(jumps=jumps)
        self.stepper.restart()
        node, changes = len(self.ts) - 1, self.mode_changes
        self.notify_discontinuity(node, mode_changed=bool(changes and changes.modes[-1][0] == node))

    def switch_mode(self, y: Array) -> None:
        """Begin a smooth interval in another mode at y: a second node at the same time."""
        self._append(self.t, y, self.zs[-1])
        self._start_at(y, restarted=True)
        self.stepper.restart()
        self.notify_discontinuity(len(self.ts) - 1, mode_changed=True)

    def continue_to(self, t1: float) -> None:
        """Move the end of the run, after the run has reached its previous end."""
        if self.state.carry is None and getattr(self.tableau, "carries", False):  # the last node ended no step
            self._start_at(self.ys[-1])
        self.t1 = t1
        self.jumps.extend(self, t1)
        self.interval = self.jumps.interval(self.t)

    def end_interval(self, node: int) -> None:
        """End a smooth interval at a node."""
        for source in self.sources:
            source.end_interval(self, node)

    def notify_discontinuity(self, node: int, mode_changed: bool = False) -> None:
        """Notify the sources of events of a discontinuity just before a node: a jump, or a mode change."""
        self.discontinuities += 1
        for source in self.sources:
            source.after_discontinuity(self, node, mode_changed)

    @property
    def dense_order(self) -> int:
        """Order of the dense output: one below the order of the method."""
        return max(1, self.system.order_of(self.tableau) - 1)

    @property
    def steps(self) -> int:
        """Number of accepted steps."""
        return len(self.ts) - 1 - self.discontinuities

    def time_to_interval_end(self) -> float:
        """Time to the end of the smooth interval, positive."""
        return abs(self.interval.stop - self.t)

    def time_left(self) -> float:
        """Time to the end of the run, positive."""
        return abs(self.t1 - self.t)

    def _append(self, t: float, y: Array, z: Array) -> None:
        """Append a node, its time last, so that an interrupt leaves the record consistent."""
        self.zs.append(z)
        self.ys.append(y)
        self.ts.append(t)

    def accept(self, t: float, step: Step) -> None:
        """Record a step."""
        self._append(t, step.state.y, step.z)
        try:
            self.state = self.system.update_independent_rows(t, step.state)
        except StepError:  # a singular configuration, where no step can begin
            del self.ts[-1:], self.ys[-1:], self.zs[-1:]
            raise
        self.t, self.ys[-1] = t, self.state.y
        self.carries.store(len(self.ts) - 1, self.state.carry, self.restarted)
        self.record_rows()

    def append_node(self, t: float, y: Array, last: bool) -> None:
        """Append a node that is not the end of a step; the last node may be singular, since no step begins there."""
        self._append(t, y, self.zs[-1])
        self.t = t
        if last:
            self.state = State(y)
        else:
            self._start_at(y)

    def projected(self, t: float, state: State, tight: bool = False) -> State:
        """Return the state projected onto the closures, with a new carry if the projection exceeds the tolerance."""
        y = self.system.project_state(t, state.y, tight)
        displacement = self.system.difference(state.y, y)
        self.restarted = not (state.carry is None or self.stepper.tolerates(self, y, displacement))
        if not self.restarted:
            return State(y, state.carry)
        return State(y, self.system.carry(*self.system.derivative(t, y)))

    def project_last_node(self) -> None:
        """Project the last node onto the closures, until |g| stops falling."""
        with suppress(StepError):
            self.state = self.projected(self.t, self.state, tight=True)
            self.ys[-1] = self.state.y
            self.partial_solution().rates.pop(len(self.ts) - 1, None)

    def extend(self, ts: list[float], ys: Array, zs: Array, state: State) -> None:
        """Record several steps and the state after the last of them."""
        if ts:
            self.zs.extend(zs)
            self.ys.extend(ys)
            self.ts.extend(ts)
            self.t, self.state = ts[-1], state

    def rows_at(self, i: int) -> tuple[int, ...]:
        """Return the rows in use at node i."""
        return next((rows for first, rows in reversed(self.in_use) if first <= i), ())

    def undo_step(self, state: State) -> None:
        """Remove the last step, which started from the given state."""
        del self.ts[-1:], self.ys[-1:], self.zs[-1:]
        self.t, self.state = self.ts[-1], state
        self.in_use = self.partial_solution().in_use = [(i, rows) for i, rows in self.in_use if i < len(self.ts)]
        self.system.use_rows(self.in_use[-1][1])

    def reject_step(self, state: State) -> None:
        """Undo the last step, which started from the given state, to repeat it with a smaller size."""
        self.stepper.undo_step()
        self.undo_step(state)
        self.rejected = (self.rejected or 0) + 1

    def truncate(self, step: "StepMap", event: Occurrence) -> None:
        """Shorten the last step so that it ends at an event."""
        self.stepper.undo_step()
        self.undo_step(step.start or State(step.y))
        if event.end is not None and event.t != step.t:
            if event.singular:
                self.append_node(event.t, event.end.state.y, last=True)
            else:
                self.accept(event.t, event.end)
        for source in self.sources:
            source.discard_beyond_end(self)

    def drop_nodes_after(self, node: int) -> None:
        """Remove the nodes after a given one."""
        del self.ts[node + 1 :], self.ys[node + 1 :], self.zs[node + 1 :]
        self.t = self.ts[-1]

    def release(self) -> None:
        """Release the workspaces of the run."""
        if self.mechanism_system:
            for source in self.sources:
                source.release()
            self.mechanism_system.mechanism.workspaces.release(self.mechanism_system)

    def nodes(self) -> tuple[Array, Array, Array]:
        """Return t (n,), y (n, ...) and z (n, nz) of the nodes so far, even after an interrupt."""
        n = len(self.ts)
        return np.array(self.ts), self.ys[:n].copy(), self.zs[:n].copy()

    def partial_solution(self) -> Solution:
        """Return the run so far as a solution that shares its lists; its dense output is used by event detection."""
        if self._partial_solution is None:
            settings, stats = {"dense_order": self.dense_order}, {"backend": self.stepper.backend}
            tables: dict[str, Any] = {"t": self.ts, "y": self.ys, "z_own": self.zs, "in_use": self.in_use}
            tables |= {"status": "finished", "message": "", "stats": stats, "settings": settings}
            tables["modes"] = self.mode_changes.modes if self.mode_changes else []
            self._partial_solution = Solution(self.problem, **tables)
        return self._partial_solution
