"""Protocol of steppers, and steps one at a time in Python."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import StepError
from ...system import Array, Step
from ..projected_step import project_end

if TYPE_CHECKING:
    from ..run_state import RunState
    from .adaptive import Adaptive

SPACINGS = 16  # of the times of a run: a step below is too small


class Stepper(ABC):
    """Interface through which the time loop takes steps."""

    backend = "python"
    any_size = True  # steps of any size can be taken, to end in an event
    controls = False  # it controls the step size

    @property
    def control(self) -> "Adaptive | None":
        """The step-size control of mbdae, if it controls the steps."""
        return None

    @abstractmethod
    def advance(self, run: "RunState", most: int | None = None) -> None:
        """Try one or several steps, up to a limit, and record the accepted ones.

        Raises:
            StepError: if no step can be taken.
        """

    @abstractmethod
    def take(self, run: "RunState", h: float) -> Step:
        """Take a step of size h (signed) from the current state; nothing is recorded."""

    @abstractmethod
    def measure(self, run: "RunState", y: Array, move: Array) -> float:
        """Return the norm of a move of the state away from y, in tolerances."""

    def tolerates(self, run: "RunState", y: Array, move: Array) -> bool:
        """Say whether a move of the state away from y stays within the tolerance of a step."""
        return self.measure(run, y, move) <= 1

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """Return the settings that are recorded with the solution."""

    def restart(self) -> None:  # noqa: B027, most have nothing to do
        """Restart after a jump: the history of steps is discarded."""

    def bound(self, h: float) -> None:  # noqa: B027
        """Limit the next step, if its size is chosen."""

    def take_back(self) -> None:  # noqa: B027
        """The last step was truncated."""


class PythonStepper(Stepper):
    """One step at a time: proposed, taken, measured, accepted or rejected."""

    def advance(self, run: "RunState", most: int | None = None) -> None:
        """Take one step and accept or reject it."""
        if run.singular:
            run.singular.begin_step()
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
        if step is None or not self.judge(run, h, error):
            run.rejected = (run.rejected or 0) + 1
            return
        run.accept(t_next, step)
        if run.singular:
            run.singular.note()

    @abstractmethod
    def propose(self, run: "RunState") -> tuple[float, float]:
        """Return the size of the next step and the time where it ends."""

    @abstractmethod
    def error(self, run: "RunState", step: Step) -> float:
        """Return the error norm of a step; it is accepted up to 1."""

    @abstractmethod
    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return whether to retry with another step after one that failed for this reason."""

    def judge(self, run: "RunState", h: float, error: float) -> bool:
        """Return whether a step is accepted, and choose the next step size."""
        return error <= 1

    @abstractmethod
    def ready(self, run: "RunState") -> bool:
        """Return whether the compiled core may take the next steps."""


def smallest(t: float, t1: float) -> float:
    """Return a step that is well above the rounding of times from t to t1."""
    return SPACINGS * float(np.spacing(max(abs(t), abs(t1))))
