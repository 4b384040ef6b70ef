"""Many steps of a run at once, in the compiled core; Python handles events, jumps and the user in between."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...methods.controller import COMPANION, SAFETY, SMALLEST_ERROR, SMALLEST_LAST
from ...system import Array, State, Step
from ...tolerances import AGREEMENT, COINCIDENT, TINY
from ..events.jumps import MARGIN, MAX_CLUSTER, SmoothInterval
from ..events.level_crossing import ITERATIONS, SHARE, SHARP
from ..projected_step import TAKEN_BACK
from .adaptive import Adaptive
from .fixed import TOLERATED, Fixed
from .stepper import SPACINGS, PythonStepper, Stepper

if TYPE_CHECKING:
    from ..._native import Run
    from ..run_state import RunState

SECONDS = 0.05  # of computing between checks of progress and Ctrl-C
MANY = 2000  # steps


class NativeStepper(Stepper):
    """Stepper that uses the compiled core.

    Args:
        inner: chooses step sizes, and takes the steps that the core cannot.
        system: the run's workspace.
        tableau: a method.
        project: whether positions are projected.
    """

    backend = "native"

    def __init__(self, inner: PythonStepper, system: Any, tableau: Any, project: bool) -> None:
        self.inner, self.system, self.tableau = inner, system, tableau
        self.controls = inner.controls
        self.run: Run = system.native.Run()
        self.run.project, self.run.seconds = project, SECONDS
        self.watched: Any = None

    @property
    def control(self) -> Adaptive | None:
        return self.inner.control

    def advance(self, run: "RunState", most: int | None = None) -> None:
        """Take steps until Python is needed, for about `SECONDS`; one in Python if necessary.

        Afterwards, steps, rejections and the state are those of the run, even if this is interrupted.
        """
        some = MANY if most is None else min(most, MANY)
        if run.taken_back is not None or not (self.inner.ready(run) and self._advance_core(run, some)):
            self.inner.advance(run)

    def take(self, run: "RunState", h: float) -> Step:
        return self.inner.take(run, h)

    def measure(self, run: "RunState", y: Array, move: Array) -> float:
        return self.inner.measure(run, y, move)

    def settings(self) -> dict[str, Any]:
        return self.inner.settings()

    def restart(self) -> None:
        self.inner.restart()

    def bound(self, h: float) -> None:
        self.inner.bound(h)

    def take_back(self) -> None:
        self.inner.take_back()

    def _advance_core(self, run: "RunState", most: int) -> int:
        """Let the core try steps; return how many, 0 if the next one needs Python."""
        self._to_native(run, most)
        try:
            self.system.advance(self.tableau, self.run)
        finally:
            self._from_native()
            run.rejected = (run.rejected or 0) + self.run.rejected
            self._record(run)
        return self.run.taken + self.run.rejected

    def _to_native(self, run: "RunState", most: int) -> None:
        """Pass the position of the run, its step size, and all thresholds to the core."""
        r, leg, watch, inner = self.run, self.run.leg, run.singular, self.inner
        r.begin(run.state.y, self.system.carried(run.state), run.state.compensation)
        self._events_to_native(run)
        r.kept = run.carried.capacity_left(len(run.ts))
        r.taken_back, r.nothing = TAKEN_BACK, TINY
        r.budget, r.watched, r.adaptive = most, watch is not None, isinstance(inner, Adaptive)
        leg.t, leg.t1, leg.sign, leg.stop, leg.end = run.t, run.t1, run.sign, run.leg.stop, run.leg.end
        if watch:
            w = r.watch
            w.usual, w.before, w.suspect, w.landed, w.zone, w.ahead = watch.limits()
            w.entered = watch.entered is not None
        if isinstance(inner, Adaptive):
            c, pi = r.control, inner.controller
            c.h, c.cut, c.last, c.rejected = inner.h, inner.cut, pi.last, pi.rejected
            c.largest, c.nearly, c.spacings = min(inner.largest, inner.cap), AGREEMENT, SPACINGS
            c.rtol, c.atol, c.nothing, c.companion = (
                float(inner.rtol),
                inner.atol.ravel().tolist(),
                TINY,
                COMPANION,
            )
            c.power, c.exponent, c.last_exponent = pi.power, pi.exponent, pi.beta
            c.safety, c.smallest_factor, c.largest_factor = SAFETY, pi.control.smallest, pi.control.largest
            c.blend = self.tableau.blend
            c.steady, c.smallest_error, c.smallest_last = pi.steady, SMALLEST_ERROR, SMALLEST_LAST
        elif isinstance(inner, Fixed):
            g = r.grid
            g.step, g.t0, g.n, g.i, g.on_grid = inner.step, inner.t0, inner.n, inner.i, inner.on_grid
            g.near, r.tolerated = COINCIDENT, TOLERATED

    def _events_to_native(self, run: "RunState") -> None:
        """Pass events and upcoming jumps to the core; Python evaluates functions step by step."""
        e, j, events = self.run.events, self.run.jumps, run.events
        if self.watched is not events:
            self.watched = events
            e.watch(events.core_data() if events.by_signal else [])
            e.same, e.spacings, e.share, e.iterations = AGREEMENT, SHARP, SHARE, ITERATIONS
            of_drivers = self.system.constraints.breaks
            j.times = sorted({*run.ahead.times, *self.system.laws.breaks(), *of_drivers})
            j.margin, j.crowd = MARGIN, MAX_CLUSTER
        j.crossed = (events.by_signal or not events.events) and not run.modes
        j.restart = np.nan if run.leg.restart is None else run.leg.restart
        if events.events and events.by_signal:
            e.start = events.origin[0]
            e.stand([signal.node for signal in events.signals.values()])

    def _from_native(self) -> None:
        c, g, inner = self.run.control, self.run.grid, self.inner
        if isinstance(inner, Adaptive):
            inner.h, inner.cut, inner.controller.last, inner.controller.rejected = c.h, c.cut, c.last, c.rejected
        elif isinstance(inner, Fixed):
            inner.i, inner.on_grid = g.i, g.on_grid

    def _record(self, run: "RunState") -> None:
        r, watch, first = self.run, run.singular, len(run.ts)
        ts, ys, zs, least_pivot_ratio = r.steps()
        if not len(ts):
            return
        run.carried.extend(first, *r.carried())
        run.in_use += [(first + k, tuple(rows)) for k, rows in r.changes]
        run.events.adopt_native(r.events)
        state, leg = State(*r.state()), r.leg
        restart = None if np.isnan(r.jumps.restart) else r.jumps.restart
        times, i, behind = ts.tolist(), 0, r.behind
        finished = times[-1] == run.t1
        if watch:
            watch.begin_step()
        for n in [*behind, len(times)]:
            end = finished and n == len(times)
            while i < n:
                quiet = watch.quiet(least_pivot_ratio[i : n - end]) if watch and not run.modes else n - i
                run.extend(times[i : i + quiet], ys[i : i + quiet], zs[i : i + quiet], state)
                i += quiet
                if watch and i < n:
                    run.extend(times[i : i + 1], ys[i : i + 1], zs[i : i + 1], state)
                    self.system.least_pivot_ratio, i = float(least_pivot_ratio[i]), i + 1
                    watch.note()
                    if watch.inspect(run, end and i == n):
                        run.close()
            if n < len(times):
                run.end_interval()
                run.extend(times[n : n + 1], ys[n : n + 1], zs[n : n + 1], state)
                run.restart()
                i = n + 1
        if watch and run.modes:  # guards come first, which may truncate the step
            self.system.least_pivot_ratio = float(least_pivot_ratio[-1])
            watch.note()
        run.leg = SmoothInterval(leg.stop, leg.end, restart)
