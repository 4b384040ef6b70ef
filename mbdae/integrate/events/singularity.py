"""Monitoring of rank loss of the constraints: detection, crossing by extrapolation, and a check of the branch."""

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...mechanism.formulations.index2 import Index2System
from ...system import Array
from ...tolerances import NEGLIGIBLE, VISIBLE
from .singularity_crossing import SingularityCrossing, cross_singularity
from .singularity_location import (
    ADJACENT_RATIO,
    CROSSING_RATIO,
    MONITORED_RATIO,
    SUSPICIOUS_RATIO,
    SingularityLocation,
    falls_to_zero,
    may_vanish,
)
from .source import EventError

if TYPE_CHECKING:
    from ..._native import SingularityMonitor as CoreMonitor
    from ..run.run_state import RunState
    from ..run.step_map import StepMap
    from ..steppers.adaptive import Adaptive

APPROACH = 0.5  # fraction of the time to the singular configuration: the longest step
RETRY_FRACTION = 0.75  # fraction of the time to the singularity at the last attempt: time of the next attempt
ERROR_REDUCTION = 0.8  # fraction of the error of the last attempt: larger errors are limited by those of steps
MAX_STEP_ERROR, MAX_PROJECTION = 1e3, 100.0  # times the tolerance: error due to steps; distance from the closures
SINGULAR_RATIO = NEGLIGIBLE  # fraction of the ratio one step before: at smaller ratios the configuration is singular
MAX_RATIO_CHANGE = 0.02  # fraction of the ratio at the start of an interval: largest change in a linear backward step


class SingularityMonitor(SingularityLocation):
    """Monitor of the distance of the closure rows from linear dependence, step by step.

    The indicator is the pivot ratio of the stage solves, which costs nothing. Where it is small, a run with step-size
    control projects its states onto the closures, approaches in steps that halve the distance, and crosses by
    `singularity_crossing`. At a minimum between other steps, the smallest pivot is minimized on the dense output, and
    any singularity found is recorded.

    Branches that intersect in a singular configuration have different tangent spaces: after a crossing, the tangent
    space must be the previous one, up to its previous rate of rotation.

    Args:
        system: workspace of the run.
        enforces_g: whether the method enforces g = 0 of closures, by projection or a multiplier.
        control: step-size control of a run that may cross singular configurations; else None.
        projects: whether states must be projected where the ratio is small; not for ggl, which enforces positions.
    """

    def __init__(self, system: Index2System, enforces_g: bool, control: "Adaptive | None", projects: bool) -> None:
        super().__init__(system, enforces_g, control is not None)
        self.control, self.projects, self.newest_ratio = control, projects, 1.0
        self._reset_history(0)

    @classmethod
    def from_run(cls, run: "RunState") -> "SingularityMonitor | None":
        if not run.mechanism_system or not run.mechanism_system.ng:
            return None
        formulation = run.options.formulation
        return cls(run.mechanism_system, run.project or formulation == "ggl", run.control, formulation == "index2")

    def after_discontinuity(self, run: "RunState", node: int, mode_changed: bool) -> None:
        """Discard the history; after a mode change, reject fixed steps next to a singular configuration.

        Rounding dominates the result of steps that begin there.

        Raises:
            StepError: with the time.
        """
        self._reset_history(node)
        checked, t = run.mode_changes and run.mode_changes.checked_in_core, run.ts[node]
        if mode_changed and run.mode_changes and not checked:
            self._change_mode(run, node)
        if mode_changed and not checked and self.control is None and self.is_adjacent(t, run.ys[node]):
            raise StepError("rank", f"no step of fixed size begins next to a singular configuration, at t = {t:.17g}")

    def _reset_history(self, first: int) -> None:
        self.monitored_from: int | None = None  # the node at which the ratio became small
        self.last_attempt = np.inf, np.inf  # time to a crossing, and its error
        self._restart_ratios(first)

    def _restart_ratios(self, first: int) -> None:
        """Discard the ratios of steps before node ``first``."""
        self.origin, self.ratios = first, [np.inf]

    def begin_step(self) -> None:
        """Discard pivot ratios of solves outside the next step."""
        self.system.least_pivot_ratio = 1.0

    def reject_singular_step(self, t: float, y: Array) -> None:
        """Reject a fixed step with a stage in a singular configuration, or with its end (t, y) in one.

        Rounding dominates the result of such a stage, and no step can begin in a singular configuration.

        Raises:
            StepError: with the end time of the step.
        """
        smallest = min(float(np.sqrt(self.system.least_pivot_ratio)), self.ratios[-1])
        limit = SINGULAR_RATIO * min(self.largest, self.ratios[-1])
        if smallest < limit or (smallest < SUSPICIOUS_RATIO * self.largest and self._ratio(t, y) < limit):
            raise StepError("rank", f"a step leads into a singular configuration, until t = {t:.17g}")

    def to_core(self, monitor: "CoreMonitor") -> None:
        """Pass the ratios so far to the core."""
        monitor.largest_ratio, monitor.last_ratio = self.largest, self.ratios[-1]
        monitor.near_singular = self.monitored_from is not None
        monitor.mode_ratio = self.mode_ratio
        monitor.ratio_by_mode = [(list(mode), x) for mode, x in self.ratio_by_mode.items()]

    def skip_regular_steps(self, least_pivot_ratio: Array, inspect: bool = True) -> int:
        """Return the number of regular steps before the first suspicious step, given the smallest pivot ratio of each.

        Without ``inspect``, the core has found all of them regular.
        """
        new = np.sqrt(least_pivot_ratio)
        if self.monitored_from is not None or not len(new):
            return 0
        if not inspect:
            self.ratios += new.tolist()
            self._update(float(new.max()))
            return len(new)
        largest = np.maximum(np.maximum.accumulate(new), self.largest)
        ratios = np.concatenate([[0.0], self.ratios[-2:], new])  # 0: there is no step before the first one
        earlier, before = ratios[-len(new) - 2 : -2], ratios[-len(new) - 1 : -1]
        near = (new < MONITORED_RATIO * largest) & falls_to_zero(before, new)
        suspicious = may_vanish(earlier, before, new, largest) | near
        n = int(suspicious.argmax()) if suspicious.any() else len(new)
        self.ratios += new[:n].tolist()
        self._update(float(new[:n].max(initial=0.0)))
        return n

    def skip_regular_intervals(self, least_pivot_ratio: Array, inspect: bool) -> bool:
        """Return whether all steps of several smooth intervals are regular; if so, skip them."""
        if inspect or self.monitored_from is not None:
            return False
        self.ratios = [np.inf]
        self._update(float(np.sqrt(least_pivot_ratio.max(initial=0.0))))
        return True

    def store_ratio(self) -> None:
        """Store the pivot ratio of the last step, since other solves may follow before the step is inspected."""
        self.newest_ratio = float(np.sqrt(self.system.least_pivot_ratio))

    def first_event(self, step: "StepMap") -> None:
        """Inspect a step, if not yet done; project its end if a singular configuration is near."""
        run = step.run
        if self.origin + len(self.ratios) < len(run.ts) and self.inspect(run, run.time_left() == 0, step.ends):
            run.project_last_node()

    def inspect(self, run: "RunState", last: bool, ends: bool = False) -> bool:
        """Inspect the step before the last step, and the last step of the run; return whether to project the last node.

        Args:
            run: the run.
            last: whether the last step is the last step of the run.
            ends: whether the mode ends with the last step.

        Raises:
            EventError: for a singular configuration that the run cannot cross, or crossed onto another branch.
        """
        self.ratios.append(self.newest_ratio)
        self._update(self.ratios[-1])
        self._inspect_step(run, len(self.ratios) - 2)
        if last:
            self._inspect_end(run)
        near = self._is_near(run)
        if near and self.monitored_from is None:
            self.monitored_from = len(run.ts) - 2
        if self.monitored_from is not None and (last or not near):
            self._leave(run)
        return bool(near and self.control and self.projects and not ends)

    def _inspect_end(self, run: "RunState") -> None:
        """Inspect the last step of the run.

        Raises:
            EventError: if it ends in a singular configuration.
        """
        near = self.ratios[-1] < SUSPICIOUS_RATIO * self.largest
        if near and self._ratio(run.ts[-1], run.ys[-1]) < VISIBLE * self.largest:
            text = f"at t = {run.ts[-1]:.17g} the run ends in a singular configuration, where rounding errors dominate"
            raise EventError("rank", f"{text} velocities and multipliers: it stops one step earlier", len(run.ts) - 2)
        if not run.continues:
            self.ratios.append(self.ratios[-1])
            self._inspect_step(run, len(self.ratios) - 2)

    def _is_near(self, run: "RunState") -> bool:
        """Return whether the ratio at the last node is small, and is about to vanish or has vanished."""
        before, ratio = self.ratios[-2:]
        falls = falls_to_zero(before, ratio) or (self.monitored_from is not None and ratio >= before)
        limit = MONITORED_RATIO * self.largest
        return ratio < limit and falls and self._ratio(run.ts[-1], run.ys[-1]) < limit

    def end_interval(self, run: "RunState", node: int) -> None:
        """Inspect the last step before an impact or a jump.

        Raises:
            EventError: as in `inspect`.
        """
        self.ratios.append(np.inf)
        self._inspect_step(run, len(self.ratios) - 2)
        if self.monitored_from is not None:
            self._leave(run)

    def _leave(self, run: "RunState") -> None:
        """Return to normal steps, after a check of the branch."""
        self.check_branch(run, self.monitored_from or 0, len(run.ts) - 1)
        self.monitored_from, self.last_attempt = None, (np.inf, np.inf)
        if self.control:
            self.control.cap = np.inf

    def is_idle(self, run: "RunState", t1: float) -> bool:
        """Return whether the run is neither near a singular configuration nor at the start of an interval."""
        return self.monitored_from is None and len(run.ts) - 1 != self.origin

    def replace_step(self, run: "RunState") -> bool:
        """Near a singular configuration, limit the next step, or cross the configuration and return True.

        Raises:
            EventError: for a configuration that the run cannot cross, or crossed onto another branch.
        """
        at_start = len(run.ts) - 1 == self.origin
        if self.control is None or (self.monitored_from is None and not at_start):
            return False
        self.control.cap = np.inf
        ratio, time_ahead = self._time_to_singularity(run, at_start)
        if not time_ahead < np.inf:
            return False
        if self.monitored_from is None:
            self.monitored_from = self.origin
        self.control.cap = APPROACH * time_ahead
        if ratio > CROSSING_RATIO * self.largest or time_ahead > RETRY_FRACTION * self.last_attempt[0]:
            return False
        crossing = self._attempt(run, time_ahead)
        if crossing is None:
            if ratio < ADJACENT_RATIO * self.largest and time_ahead < run.time_to_interval_end():
                text = f"no step crosses the singular configuration near t = {run.t + run.sign * time_ahead:.9g}"
                raise EventError("rank", f"{text} with this accuracy: take a larger rtol", len(run.ts) - 1)
            return False
        self.configurations.append(crossing.singular)
        self.path = crossing.path
        run.append_node(crossing.t, crossing.y, crossing.t == run.t1)
        self.control.cap, self.control.h = np.inf, APPROACH * time_ahead
        self.last_attempt = np.inf, np.inf
        self._restart_ratios(len(run.ts) - 1)
        if self._ratio(*crossing[:2]) >= (MONITORED_RATIO if run.time_left() else SINGULAR_RATIO) * self.largest:
            self.check_branch(run, self.monitored_from, len(run.ts) - 1)
            self.monitored_from = None
        return True

    def _attempt(self, run: "RunState", time_ahead: float) -> SingularityCrossing | None:
        """Return the crossing of a singular configuration about ``time_ahead`` seconds ahead, if it is accurate."""
        assert self.control
        crossing = None
        with suppress(StepError):
            crossing = cross_singularity(self.workspace, run, time_ahead, self.origin)
        if crossing is None:
            self.last_attempt = time_ahead, np.inf
            return None
        error, distance = self.control.tolerance_norms(run, crossing.y, np.array([crossing.error, crossing.correction]))
        accurate = error <= 1 or ERROR_REDUCTION * self.last_attempt[1] <= error <= MAX_STEP_ERROR
        if not accurate or distance > MAX_PROJECTION * max(1.0, error):
            self.last_attempt = time_ahead, error
            return None
        return crossing

    def _time_to_singularity(self, run: "RunState", at_start: bool) -> tuple[float, float]:
        """Return the ratio at the last node, and the extrapolated time at which it vanishes; inf if it does not fall.

        At the start of a smooth interval, a short linear step backward, with the initial velocity, replaces the
        previous step.
        """
        dt, before = float((self.control and self.control.h) or 0.0), np.inf
        if at_start and not (dt and self.largest):  # at the start of the run
            return np.inf, np.inf
        ratio = self._ratio(run.t, run.ys[-1])
        if not at_start:
            dt, before = abs(run.t - run.ts[-2]), self._ratio(run.ts[-2], run.ys[-2])
        elif not ratio < MONITORED_RATIO * self.largest:
            return ratio, np.inf
        while at_start and abs(before - ratio) > MAX_RATIO_CHANGE * ratio:
            dt /= 2
            before = self._ratio(run.t - run.sign * dt, run.system.add(run.ys[-1], -run.sign * dt * run.F))
        return ratio, ratio * dt / (before - ratio) if ratio < before else np.inf

    def _inspect_step(self, run: "RunState", k: int) -> None:
        """Inspect step k, counted from 1, whose ratio has index k."""
        before, ratio, after = self.ratios[max(0, k - 1) : k + 2] if k else (0.0, 1.0, 0.0)
        if not ratio < before or not may_vanish(before, ratio, after, self.largest):
            return
        nodes = range(max(0, k - 2), min(k + 2, len(run.ts) - self.origin))
        self.search(run, [self.origin + i for i in nodes])
