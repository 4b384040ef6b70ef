"""Record of the steps that the compiled core has taken in one call."""

from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from ...system import State
from ..events.core_modes import CoreTransition, modes_from_core, transitions_from_core
from ..events.jumps import SmoothInterval

if TYPE_CHECKING:
    from ..._native import Run
    from ..run.run_state import RunState


def record_steps(run: "RunState", core: "Run", system: Any) -> None:
    """Record the last steps of the core in a run.

    Args:
        run: the run.
        core: the core's run.
        system: the workspace of the run.

    Raises:
        StepError: if the run cannot continue from one of the nodes.
    """
    steps = _CoreSteps(run, core, system)
    if steps.t:
        steps.store()


class _CoreSteps:
    """The last steps of the core: the nodes at their ends, smallest pivot ratios, and the state at the last node."""

    def __init__(self, run: "RunState", core: "Run", system: Any) -> None:
        self.run, self.core, self.system = run, core, system
        ts, self.y, self.z, self.least_pivot_ratio = core.steps()
        self.t = ts.tolist()
        self.suspicious = core.monitor.suspicious

    def store(self) -> None:
        """Record all steps, with their events, mode changes and pivot ratios."""
        run, core, monitor, first = self.run, self.core, self.run.singularity_monitor, len(self.run.ts)
        run.carries.extend(first, *core.carries())
        run.in_use += [(first + k, tuple(rows)) for k, rows in core.row_changes]
        run.user_events.adopt_native(core.events)
        transitions = transitions_from_core(core.modes, run.mode_changes)
        self.unchecked = transitions is None  # Python checks the guards first, and may truncate the step
        self.state, interval = State(*core.state()), core.interval
        restart = None if isnan(core.jumps.restart) else core.jumps.restart
        if monitor:
            monitor.begin_step()
        try:
            i = self._record_intervals(transitions or {})
        finally:  # in the mode of the core, even if a transition ends the run
            if run.mode_changes and not self.unchecked:
                modes_from_core(core.modes, run.mode_changes, self.system.core, self.t[-1], self.y[-1])
        self._record_interval(i, len(self.t), self.t[-1] == run.t1)
        if monitor and core.modes.in_core:
            monitor.from_core(core.monitor)
        if monitor and self.unchecked:
            self.system.least_pivot_ratio = float(self.least_pivot_ratio[-1])
            monitor.store_ratio()
        run.interval = SmoothInterval(interval.stop, interval.end, restart)

    def _record_intervals(self, transitions: dict[int, CoreTransition]) -> int:
        """Record all smooth intervals except the last one; return the first node that is not recorded."""
        run, first, i, monitor = self.run, len(self.run.ts), 0, self.run.singularity_monitor
        starts = self.core.after_jumps
        if not starts:
            return 0
        ratios = np.delete(self.least_pivot_ratio[: starts[-1]], starts[:-1])
        regular = monitor is None or monitor.skip_regular_intervals(ratios, self.suspicious)
        n = starts[0]
        try:
            if regular:
                self._extend(0, starts[-1] + 1)
            for n in starts:
                if not regular:
                    self._record_interval(i, n, False)
                run.end_interval(first + n - 1)
                transition = transitions.get(n)
                if transition is not None:
                    run.mode_changes.adopt_transition(first + n, self.t[n - 1], transition)
                if not regular:
                    self._extend(n, n + 1)
                run.notify_discontinuity(first + n, mode_changed=transition is not None)
                i = n + 1
        except KeyboardInterrupt:
            run.drop_nodes_after(first + n - 1)  # the modes of later nodes are not recorded
            raise
        return i

    def _record_interval(self, i: int, n: int, end: bool) -> None:
        """Record the nodes i to n - 1 of a smooth interval; ``end``: at the end of the run."""
        monitor = self.run.singularity_monitor
        while i < n:
            regular = n - i
            if monitor and not self.unchecked:
                regular = monitor.skip_regular_steps(self.least_pivot_ratio[i : n - end], self.suspicious)
            if regular:
                self._extend(i, i + regular)
                i += regular
            if monitor and i < n:
                self._extend(i, i + 1)
                self.system.least_pivot_ratio, i = float(self.least_pivot_ratio[i]), i + 1
                monitor.store_ratio()
                if monitor.inspect(self.run, end and i == n):
                    self.run.project_last_node()

    def _extend(self, i: int, n: int) -> None:
        """Record the nodes i to n - 1."""
        self.run.extend(self.t[i:n], self.y[i:n], self.z[i:n], self.state)
