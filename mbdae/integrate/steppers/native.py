"""Steps of a run in the compiled core, many per call; Python handles events, mode changes and Ctrl-C in between."""

from math import nan
from typing import TYPE_CHECKING, Any, cast

from ...data_types import JsonObject
from ...mechanism.formulations.index2 import Index2System
from ...system import Array, State, Step
from ..events.core_modes import modes_to_core
from ..events.multiplier_resolution import shortest_step
from .adaptive import Adaptive
from .core_record import record_steps
from .fixed import Fixed
from .new_run import new_run
from .stepper import PythonStepper, Stepper, StepperState, smallest_step

if TYPE_CHECKING:
    from ..._native import Run
    from ..events.user_events import UserEvents
    from ..options.options import RunOptions
    from ..run.run_state import RunState

CHECK_INTERVAL = 0.05  # s of computing time between progress reports and checks for Ctrl-C
STEPS_PER_CALL = 2000  # largest number of steps in a call of the core
MAX_COMPLETED = 100  # steps of a run without sources of events: longer runs can afford their setup
MAX_UNRECORDED = 200  # steps; recording them takes about a millisecond


class NativeStepper(Stepper):
    """Stepper that uses the compiled core.

    Args:
        inner: Python stepper, which chooses step sizes, and takes the steps that the core cannot take.
        system: the workspace of the run.
        tableau: a method.
        project: whether positions are projected.
    """

    backend = "native"

    def __init__(self, inner: PythonStepper, system: Any, tableau: Any, project: bool) -> None:
        self.inner, self.system, self.tableau = inner, system, tableau
        self.controls = inner.controls
        self.fixed = cast(Fixed, inner) if self.control is None else None
        self.run = new_run(system.native, project, self.control, tableau)
        self.run.seconds = CHECK_INTERVAL
        self.events_in_core: UserEvents | None = None
        self.undecided = False  # whether the guards of the next step are left to Python
        self.switches_in_core = False
        self.unrecorded = False  # whether the core has steps that are not recorded
        self.attempted = self.ahead = False  # whether the core has tried to begin; has taken the first steps
        self.start: tuple[Array, Array, Array] | None = None  # where it began: y, y' and z

    @property
    def control(self) -> Adaptive | None:
        return self.inner.control

    def complete(self, run: "RunState") -> bool:
        r, m = self.run, self.run.monitor
        first_point = None if _needs_sources(run.options, self.system) else self._begin_in_core(run, run.ys[-1])
        if not first_point or r.interval.t != run.t1 or r.taken > MAX_COMPLETED:
            return False
        if m.suspicious or m.last_ratio < m.suspicious_ratio * m.largest_ratio:
            return False
        run.set_start(*first_point)
        run.rejected, (ts, ys, zs, _) = r.rejected, r.steps()
        run.carries.extend(1, *r.carries())
        self.system.adopt_rows(r)
        run.in_use += [(1 + k, tuple(rows)) for k, rows in r.row_changes]
        run.extend(ts.tolist(), ys, zs, State(ys[-1]))
        return True

    def begin_run(self, run: "RunState", y: Array, ahead: bool) -> tuple[Array, Array, Array]:
        needs_python = run.user_events.events or any(source.each_step for source in run.sources)
        if ahead and not self.attempted and not needs_python:
            self._begin_in_core(run, y)
        self.ahead = bool(self.start)
        return self.start or super().begin_run(run, y, ahead)

    def _begin_in_core(self, run: "RunState", y: Array) -> tuple[Array, Array, Array] | None:
        """Return the first point, y' and z by the core, which also tries the first steps; None if it cannot begin."""
        control, system = self.control, self.system
        if not system.starts_in_core or system.core.calls_python or not run.time_left() > 0 or (control and control.h):
            return None
        run.state, self.attempted = State(y), True
        self._to_native(run, min(run.options.max_steps or STEPS_PER_CALL, STEPS_PER_CALL))
        first = control and control.first_step_data(run)
        self.start = system.begin(self.tableau, self.run, smallest_step(run.t, run.t1), first)
        return self.start

    def advance(self, run: "RunState", max_steps: int | None = None) -> None:
        """Take steps until Python is needed, for about `CHECK_INTERVAL`; one step in Python if necessary.

        Steps, rejections and the state of the run are up to date afterwards, even after an interrupt.
        """
        n = STEPS_PER_CALL if max_steps is None else min(max_steps, STEPS_PER_CALL)
        if run.undone_motion is not None or not self._advance_core(run, n):
            self.inner.advance(run)

    def continue_unrecorded(self, run: "RunState", t1: float) -> bool:
        r = self.run
        if not all(source.is_idle(run, t1) for source in run.sources):
            return False
        if not self.unrecorded:
            if run.undone_motion is not None or not self.inner.ready_for_core(run):
                return False
            self._to_native(run, MAX_UNRECORDED)
        interval = r.interval
        interval.t1 = interval.stop = interval.end = t1
        r.continued, self.unrecorded = self.unrecorded, True
        try:
            self.system.advance(self.tableau, r)
        finally:
            r.continued = False
        return interval.t == t1 and not r.monitor.suspicious

    def core_run(self, run: "RunState") -> "Run":
        """Return the run of the core, at the position of this run."""
        self.inner.ready_for_core(run)  # chooses the first step size
        self._to_native(run, MAX_UNRECORDED)
        return self.run

    def core_run_before_start(self, run: "RunState") -> "Run":
        """Return the run of the core before this run begins; its first step is 0 if it must be estimated."""
        run.interval = run.jumps.interval(run.t)
        self._to_native(run, MAX_UNRECORDED)
        self.run.max_carries = 0
        return self.run

    def record(self, run: "RunState") -> None:
        if self.unrecorded:
            self.unrecorded = False
            self._take_from_core(run)
            run.t1 = run.t

    def time(self, run: "RunState") -> float:
        return self.run.interval.t if self.unrecorded else run.t

    def point(self, run: "RunState") -> Array:
        return self.run.state()[0] if self.unrecorded else run.ys[-1]

    def node_count(self, run: "RunState") -> int:
        return len(run.ts) + self.unrecorded * self.run.taken

    def take(self, run: "RunState", h: float) -> Step:
        return self.inner.take(run, h)

    def tolerance_norms(self, run: "RunState", y: Array, displacements: Array) -> list[float]:
        return self.inner.tolerance_norms(run, y, displacements)

    def settings(self) -> JsonObject:
        return self.inner.settings()

    def restart(self) -> None:
        self.inner.restart()

    def limit_step(self, h: float) -> None:
        self.inner.limit_step(h)

    def snapshot(self) -> StepperState:
        return self.inner.snapshot()

    def resume(self, snapshot: StepperState) -> None:
        self.inner.resume(snapshot)

    def undo_step(self) -> None:
        self.inner.undo_step()

    def _advance_core(self, run: "RunState", max_steps: int) -> int:
        """Let the core try steps; return their number, 0 if the next step needs Python."""
        if self.ahead:
            self.ahead = False
            self.system.adopt_rows(self.run)
            self._take_from_core(run)
            return self.run.taken + self.run.rejected
        if not self.inner.ready_for_core(run):
            return 0
        modes, changes = self.run.modes, run.mode_changes
        modes.in_core = bool(changes and not changes.each_step and not self.undecided and max_steps > 1)
        if modes.in_core:
            if not self.switches_in_core:
                modes.set_switches(changes.core_switches or [])
                modes.unswitched, self.switches_in_core = changes.unswitched.tolist(), True
            modes_to_core(modes, changes, shortest_step(run))
        elif changes:
            max_steps = 1
        self._to_native(run, max_steps)
        try:
            self.system.advance(self.tableau, self.run)
        finally:
            self._take_from_core(run)
        self.undecided, tried = modes.undecided, self.run.taken + self.run.rejected
        return self._advance_core(run, 1) if self.undecided and not tried else tried

    def _take_from_core(self, run: "RunState") -> None:
        """Record the steps of the core, and adopt its step sizes."""
        self._from_native()
        run.rejected = (run.rejected or 0) + self.run.rejected
        record_steps(run, self.run, self.system)
        self.system.laws.set_inputs(self.system.element_states(run.state.y))

    def _to_native(self, run: "RunState", max_steps: int) -> None:
        """Pass the position of the run and its step size to the core."""
        r, interval = self.run, self.run.interval
        r.set_state(run.state.y, self.system.core_carry(run.state), run.state.compensation)
        r.max_carries = run.carries.capacity_left(len(run.ts))
        r.max_steps, r.monitored = max_steps, self.system.ng > 0
        interval.t, interval.t1, interval.sign = run.t, run.t1, run.sign
        interval.stop, interval.end = run.interval.stop, run.interval.end
        if run.sources:
            self._events_to_native(run)
        if monitor := run.singularity_monitor:
            monitor.to_core(r.monitor)
        if adaptive := self.control:
            c, pi = r.control, adaptive.controller
            c.h, c.uncut_size = adaptive.h or 0.0, adaptive.size_before_truncation
            c.last, c.rejected = pi.last, pi.rejected
            c.largest = min(adaptive.max_step, adaptive.cap)
        elif fixed := self.fixed:
            g = r.grid
            g.step, g.t0, g.n, g.i, g.on_grid = fixed.step, fixed.t0, fixed.n, fixed.i, fixed.on_grid

    def _events_to_native(self, run: "RunState") -> None:
        """Pass events of signals and upcoming jumps to the core; Python evaluates event functions after each step."""
        e, j, events = self.run.events, self.run.jumps, run.user_events
        if self.events_in_core is not events:
            self.events_in_core = events
            if events.events and events.by_signal:
                e.set_events(events.core_data())
            driver_times = self.system.constraints.nonsmooth_times
            j.times = sorted({*run.jumps.times, *self.system.laws.nonsmooth_times(), *driver_times})
        j.in_core = (events.by_signal or not events.events) and not run.mode_changes
        j.restart = nan if run.interval.restart is None else run.interval.restart
        if events.events and events.by_signal:
            e.start = events.origin[0]
            e.set_nodes([signal.node for signal in events.signals.values()])

    def _from_native(self) -> None:
        if adaptive := self.control:
            c, pi = self.run.control, adaptive.controller
            adaptive.h, adaptive.size_before_truncation, pi.last, pi.rejected = c.h, c.uncut_size, c.last, c.rejected
        elif fixed := self.fixed:
            fixed.i, fixed.on_grid = self.run.grid.i, self.run.grid.on_grid


def _needs_sources(options: "RunOptions", system: Index2System) -> bool:
    """Return whether sources may have events in a run that stays away from singular configurations."""
    mech, jumps = system.mechanism, options.jumps
    has_times = mech.drivers or system.laws.time_dependent or not (isinstance(jumps, tuple) and not jumps)
    return bool(options.events or mech.switches or mech.resets or has_times)
