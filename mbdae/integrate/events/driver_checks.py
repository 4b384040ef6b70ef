"""Checks of drivers: derivatives that contradict their functions, motions that contradict closures or each other."""

from typing import TYPE_CHECKING

from ...errors import StepError
from ...mechanism.formulations.steps.projection import require_compatible_accelerations
from .source import EventSource

if TYPE_CHECKING:
    from ..run.run_state import RunState


class DriverChecks(EventSource):
    """Check of the drivers of a run at its end, or after a failure that drivers may have caused."""

    @classmethod
    def from_run(cls, run: "RunState") -> "DriverChecks | None":
        return cls() if run.problem.drivers else None

    def finish(self, run: "RunState") -> None:
        self._check(run, run.t)

    def explain(self, run: "RunState", reason: StepError) -> StepError:
        if reason.status not in ("step_size", "max_steps"):
            return reason
        try:
            self._check(run, run.t1)
            if run.mechanical:
                require_compatible_accelerations(run.mechanical, run.t, run.ys[-1])
        except StepError as cause:
            return cause
        return reason

    def _check(self, run: "RunState", end: float) -> None:
        for driver in run.problem.drivers:
            driver.check_run(run.options.t0, end)
