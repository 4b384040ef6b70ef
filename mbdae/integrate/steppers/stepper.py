"""Interface of steppers, and steppers that take one step at a time in Python."""

from abc import ABC, abstractmethod
from math import ulp
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...errors import StepError
from ...system import Array, Step
from .projected_step import project_end

if TYPE_CHECKING:
    from ..run.run_state import RunState
    from .adaptive import Adaptive

SPACINGS = 16  # smallest step size in units of the spacing of t

StepperState = tuple[Any, ...]  # state of step-size control: only `resume` of the same stepper reads it


class Stepper(ABC):
    """Interface through which the time loop takes steps."""

    backend = "python"
    any_size = True  # whether steps of any size can be taken, to end at an event
    controls = False  # whether it controls the step size

    @property
    def control(self) -> "Adaptive | None":
        """The step-size control of mbdae; None if the stepper does not use it."""
        return None

    def complete(self, run: "RunState") -> bool:
        """Complete a run without sources of events from its start, in one call of the core; return whether it did.

        If not, the run may begin with its sources.
        """
        return False

    def begin_run(self, run: "RunState", y: Array, ahead: bool) -> tuple[Array, Array, Array]:
        """Return the first point, y' and z, see `mbdae.system.System.start`; ``ahead``: it may also take steps."""
        return run.system.start(run.t, y, run.project)

    @abstractmethod
    def advance(self, run: "RunState", max_steps: int | None = None) -> None:
        """Try one or several steps, up to a limit, and record the accepted steps.

        Raises:
            StepError: if no step can be taken.
        """

    def continue_unrecorded(self, run: "RunState", t1: float) -> bool:
        """Step to t1 if no source of events must check the steps, and leave their recording to `record`.

        Return False if the time loop must continue, after `record`.
        """
        return False

    def record(self, run: "RunState") -> None:  # noqa: B027
        """Record the steps of `continue_unrecorded`."""

    def time(self, run: "RunState") -> float:
        """Return the time after the last step, recorded or not."""
        return run.t

    def point(self, run: "RunState") -> Array:
        """Return the point (n,) after the last step, recorded or not."""
        return run.ys[-1]

    def node_count(self, run: "RunState") -> int:
        """Return the number of nodes, recorded or not."""
        return len(run.ts)

    @abstractmethod
    def take(self, run: "RunState", h: float) -> Step:
        """Take a step of size h (signed) from the current state; nothing is recorded."""

    @abstractmethod
    def tolerance_norms(self, run: "RunState", y: Array, displacements: Array) -> list[float]:
        """Return the norms of displacements of the state from y, (k, ny), in units of the tolerance."""

    def tolerates(self, run: "RunState", y: Array, displacement: Array) -> bool:
        """Return whether a displacement of the state from y is within the tolerance of a step."""
        return self.tolerance_norms(run, y, displacement[None])[0] <= 1

    @abstractmethod
    def settings(self) -> JsonObject:
        """Return the settings that are recorded with the solution."""

    def restart(self) -> None:  # noqa: B027, optional
        """Discard the history of steps, after a discontinuity."""

    def limit_step(self, h: float) -> None:  # noqa: B027
        """Limit the size of the next step, if it is controlled."""

    def snapshot(self) -> StepperState:
        """Return the data that determine the next step sizes."""
        return ()

    def resume(self, snapshot: StepperState) -> None:  # noqa: B027
        """Continue from a snapshot."""

    def undo_step(self) -> None:  # noqa: B027
        """Undo the last step."""


class PythonStepper(Stepper):
    """Stepper that takes one step at a time in Python."""

    def advance(self, run: "RunState", max_steps: int | None = None) -> None:
        """Take one step and accept or reject it."""
        if run.singularity_monitor:
            run.singularity_monitor.begin_step()
        h, t_next = self.propose(run)
        try:
            step = self.take(run, run.sign * h)
            error = self.error(run, step)
            if run.project and error <= 1:
                step = step._replace(state=project_end(run, t_next, step.state))
        except StepError as e:
            if not self.may_retry(run, h, e):
                raise
            step, error = None, np.inf
        if step is None or not self.accept_or_reject(run, h, error):
            run.rejected = (run.rejected or 0) + 1
            return
        run.accept(t_next, step)
        if run.singularity_monitor:
            run.singularity_monitor.store_ratio()

    @abstractmethod
    def propose(self, run: "RunState") -> tuple[float, float]:
        """Return the size of the next step and its end time."""

    @abstractmethod
    def error(self, run: "RunState", step: Step) -> float:
        """Return the error norm of a step; the step is accepted up to 1."""

    @abstractmethod
    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return whether to try another step after a step that failed for this reason."""

    def accept_or_reject(self, run: "RunState", h: float, error: float) -> bool:
        """Choose the next step size; return whether the step is accepted."""
        return error <= 1

    @abstractmethod
    def ready_for_core(self, run: "RunState") -> bool:
        """Return whether the compiled core may take the next steps."""


def smallest_step(t: float, t1: float) -> float:
    """Return the smallest step size, well above the rounding of times from t to t1."""
    return SPACINGS * ulp(max(abs(t), abs(t1)))
