"""Checks of drivers: derivatives that contradict their functions, motions that closures or other drivers exclude."""

from typing import TYPE_CHECKING

from ...errors import StepError
from ...mechanism.formulations.dead_point import require_no_dead_point
from ...mechanism.formulations.steps.projection import require_compatible_accelerations
from .source import EventSource

if TYPE_CHECKING:
    from ..run.run_state import RunState

STATUSES = ("step_size", "max_steps", "newton", "singular", "rank")  # failures that drivers may cause
MARGIN = 1 / 16  # fraction of the time span after a failure: samples there reveal an inconsistent derivative


class DriverChecks(EventSource):
    """Check of the drivers of a run at its end, or after a failure that drivers may have caused.

    It has no events, but is an event source so that it is called at the end of a run.
    """

    @classmethod
    def from_run(cls, run: "RunState") -> "DriverChecks | None":
        return cls() if run.problem.drivers else None

    def finish(self, run: "RunState") -> None:
        self._check(run, run.t)

    def explain(self, run: "RunState", reason: StepError) -> StepError:
        if reason.status not in STATUSES or not run.mechanism_system:
            return reason
        start, end = run.options.t0, run.t1
        reached = (run.t - start) / (end - start)
        try:
            require_no_dead_point(run.mechanism_system, run.t, run.ys[-1], run.sign, run.options.step or 0.0)
            if reason.status in ("step_size", "max_steps"):  # a smaller step does not remove an inconsistent derivative
                self._check(run, start + min(1.0, reached + MARGIN) * (end - start))
                require_compatible_accelerations(run.mechanism_system, run.t, run.ys[-1])
        except StepError as cause:
            return cause
        return reason

    def _check(self, run: "RunState", end: float) -> None:
        for driver in run.problem.drivers:
            driver.check_run(run.options.t0, end)
