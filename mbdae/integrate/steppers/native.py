"""Steps of a run in the compiled core, many per call; Python handles events, mode changes and Ctrl-C in between."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...methods.controller import COMPANION, SAFETY, SMALLEST_ERROR, SMALLEST_LAST
from ...system import Array, Step
from ...tolerances import AGREEMENT, COINCIDENT, TINY
from ..events.core_modes import modes_to_core, set_constants
from ..events.jumps import MARGIN, MAX_CLUSTER
from ..events.level_crossing import MAX_ITERATIONS, RELATIVE_TOLERANCE, TIME_SPACINGS
from ..events.load_resolution import shortest_step
from ..events.singularity import ADJACENT_RATIO, MAX_RATIO_CHANGE, SINGULAR_RATIO
from ..events.singularity_location import AHEAD, MONITORED_RATIO, NOTCH, SMALL, SUSPICIOUS_RATIO
from .adaptive import Adaptive
from .core_record import record_steps
from .fixed import FIXED_STEP_TOLERANCE, Fixed
from .projected_step import MAX_UNDONE
from .stepper import SPACINGS, PythonStepper, Stepper, StepperState

if TYPE_CHECKING:
    from ..._native import Run
    from ..events.user_events import UserEvents
    from ..run.run_state import RunState

CHECK_INTERVAL = 0.05  # s of computing between progress reports and checks for Ctrl-C
STEPS_PER_CALL = 2000  # largest number of steps in a call of the core
MAX_UNRECORDED = 200  # steps: to record them takes about a millisecond


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
        self.run: Run = system.native.Run()
        self.run.project, self.run.seconds = project, CHECK_INTERVAL
        self.passed_events: UserEvents | None = None
        self.undecided = False  # whether the guards of the next step are left to Python
        self.passed_switches = False
        self.unrecorded = False  # whether the core has steps that are not recorded
        self.adaptive = inner if isinstance(inner, Adaptive) else None
        self.fixed = inner if isinstance(inner, Fixed) else None
        self._constants_to_native()

    @property
    def control(self) -> Adaptive | None:
        return self.inner.control

    def advance(self, run: "RunState", max_steps: int | None = None) -> None:
        """Take steps until Python is needed, for about `CHECK_INTERVAL`; one step in Python if necessary.

        Steps, rejections and the state of the run are up to date afterwards, even after an interrupt.
        """
        some = STEPS_PER_CALL if max_steps is None else min(max_steps, STEPS_PER_CALL)
        if run.undone_motion is not None or not (self.inner.ready_for_core(run) and self._advance_core(run, some)):
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
        """Return the core's run, at the position of this one."""
        self.inner.ready_for_core(run)  # chooses the first step size
        self._to_native(run, MAX_UNRECORDED)
        return self.run

    def core_run_before_start(self, run: "RunState") -> "Run":
        """Return the core's run before this one begins; its first step is 0 where it must be estimated."""
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

    def nodes(self, run: "RunState") -> int:
        return len(run.ts) + self.unrecorded * self.run.taken

    def take(self, run: "RunState", h: float) -> Step:
        return self.inner.take(run, h)

    def tolerance_norm(self, run: "RunState", y: Array, move: Array) -> float:
        return self.inner.tolerance_norm(run, y, move)

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
        modes, changes = self.run.modes, run.mode_changes
        modes.in_core = bool(changes and not changes.each_step and not self.undecided and max_steps > 1)
        if modes.in_core:
            if not self.passed_switches:
                modes.set_switches(changes.core_switches or [])
                modes.unswitched, self.passed_switches = changes.always.tolist(), True
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
        """Record the steps of the core, and take over its step sizes."""
        self._from_native()
        run.rejected = (run.rejected or 0) + self.run.rejected
        record_steps(run, self.run, self.system)
        self.system.laws.set_inputs(self.system.element_states(run.state.y))

    def _constants_to_native(self) -> None:
        """Pass all thresholds to the core."""
        r, c = self.run, self.run.control
        r.max_undone, r.tiny, r.adaptive = MAX_UNDONE, TINY, self.adaptive is not None
        r.grid.coincident, r.tolerated_move = COINCIDENT, FIXED_STEP_TOLERANCE
        set_constants(r.modes)
        m = r.monitor
        m.suspicious_ratio, m.singular_ratio, m.monitored_ratio = SUSPICIOUS_RATIO, SINGULAR_RATIO, MONITORED_RATIO
        m.notch_ratio, m.small_ratio, m.steps_ahead = NOTCH, SMALL, AHEAD
        m.adjacent_ratio, m.max_change = ADJACENT_RATIO, MAX_RATIO_CHANGE
        if self.adaptive:
            pi = self.adaptive.controller
            c.agreement, c.spacings, c.tiny, c.companion = AGREEMENT, SPACINGS, TINY, COMPANION
            c.rtol, c.atol = float(self.adaptive.rtol), self.adaptive.atol.ravel().tolist()
            c.power, c.exponent, c.last_exponent = pi.power, pi.exponent, pi.beta
            c.safety, c.smallest_factor, c.largest_factor = SAFETY, pi.control.smallest, pi.control.largest
            c.blend = self.tableau.blend
            c.steady, c.smallest_error, c.smallest_last = pi.steady, SMALLEST_ERROR, SMALLEST_LAST

    def _to_native(self, run: "RunState", max_steps: int) -> None:
        """Pass the position of the run and its step size to the core."""
        r, interval, monitor = self.run, self.run.interval, run.singularity_monitor
        r.set_state(run.state.y, self.system.core_carry(run.state), run.state.compensation)
        self._events_to_native(run)
        r.max_carries = run.carries.capacity_left(len(run.ts))
        r.max_steps, r.monitored = max_steps, monitor is not None
        interval.t, interval.t1, interval.sign = run.t, run.t1, run.sign
        interval.stop, interval.end = run.interval.stop, run.interval.end
        if monitor:
            monitor.to_core(r.monitor)
        if adaptive := self.adaptive:
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
        if self.passed_events is not events:
            self.passed_events = events
            e.set_events(events.core_data() if events.by_signal else [])
            e.agreement, e.iterations = AGREEMENT, MAX_ITERATIONS
            e.spacings, e.step_tolerance = TIME_SPACINGS, RELATIVE_TOLERANCE
            of_drivers = self.system.constraints.breaks
            j.times = sorted({*run.jumps.times, *self.system.laws.breaks(), *of_drivers})
            j.margin, j.max_cluster = MARGIN, MAX_CLUSTER
        j.in_core = (events.by_signal or not events.events) and not run.mode_changes
        j.restart = np.nan if run.interval.restart is None else run.interval.restart
        if events.events and events.by_signal:
            e.start = events.origin[0]
            e.set_nodes([signal.node for signal in events.signals.values()])

    def _from_native(self) -> None:
        if adaptive := self.adaptive:
            c, pi = self.run.control, adaptive.controller
            adaptive.h, adaptive.size_before_truncation, pi.last, pi.rejected = c.h, c.uncut_size, c.last, c.rejected
        elif fixed := self.fixed:
            fixed.i, fixed.on_grid = self.run.grid.i, self.run.grid.on_grid
