"""Who takes the steps of a run: one protocol, and one step at a time in Python."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import StepError
from ...system import Array, Step

if TYPE_CHECKING:
    from ..run import RunState

SPACINGS = 16  # of the times of a run: a step below is too small


class Stepper(ABC):
    """What the time loop asks for steps."""

    backend = "python"
    any_size = True  # steps of any size can be taken, to end in an event
    controls = False  # it chooses their size

    @abstractmethod
    def advance(self, run: "RunState", most: int | None = None) -> None:
        """Try one step or several, at most so many, and record those that are accepted.

        Raises:
            StepError: where no step can be taken.
        """

    @abstractmethod
    def take(self, run: "RunState", h: float) -> Step:
        """Take a step of size h (signed) from where the run stands; nothing is recorded."""

    @abstractmethod
    def tolerates(self, run: "RunState", y: Array, move: Array) -> bool:
        """Say whether a move of the state away from y stays within the tolerance of a step."""

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """What is recorded with the solution."""

    def restart(self) -> None:  # noqa: B027, most have nothing to do
        """Begin anew behind a jump: nothing of the steps before it holds."""

    def bound(self, h: float) -> None:  # noqa: B027
        """Let the next step be no longer, where its size is chosen."""

    def take_back(self) -> None:  # noqa: B027
        """The last step ends before its end."""


class PythonStepper(Stepper):
    """One step at a time: proposed, taken, measured, judged."""

    def advance(self, run: "RunState", most: int | None = None) -> None:
        """Take one step and accept or reject it."""
        if run.singular:
            run.singular.begin_step()
        h, t_next = self.propose(run)
        try:
            step = self.take(run, run.sign * h)
            error = self.error(run, step)
            if run.project and error <= 1:
                step = step._replace(state=run.restored(t_next, step.state))
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
            if not run.modes:  # else guards come first, which may cut the step
                run.singular.step(run, run.time_left() == 0)

    @abstractmethod
    def propose(self, run: "RunState") -> tuple[float, float]:
        """Return the size of the next step and the time where it ends."""

    @abstractmethod
    def error(self, run: "RunState", step: Step) -> float:
        """Return the error norm of a step; it is accepted up to 1."""

    @abstractmethod
    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Say whether another step is worth a try after one that could not be taken for this reason."""

    def judge(self, run: "RunState", h: float, error: float) -> bool:
        """Say whether a step is accepted, and choose the next one."""
        return error <= 1

    @abstractmethod
    def ready(self, run: "RunState") -> bool:
        """Say whether the compiled core may take the next steps."""


def smallest(t: float, t1: float) -> float:
    """A step that is well above the rounding of times from t to t1."""
    return SPACINGS * float(np.spacing(max(abs(t), abs(t1))))
