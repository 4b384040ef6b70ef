"""Interface between the time loop and the sources of events.

After each step the sources detect, in their order, their first event in it; one that lies before the end of the step
truncates it, so the next source checks the shorter step. The source of the earliest event acts: it ends the run, or
continues it from another point or in another mode. In order, the sources are

1. `driver_checks`, at the end of the run only;
2. `hybrid`: guards of contacts, stops, clutches and stiction;
3. `singularity`: singular configurations, which are crossed by extrapolation in place of a step;
4. `mbdae.integrate.stiffness_detection`, which warns only;
5. `user_events`: signals and functions, of which terminal ones end the run;
6. `jumps`: controllers, functions of time and times given by the user.

Sources read the run; those that continue it from another point do so by its methods.
"""

from typing import TYPE_CHECKING, Any, NamedTuple, Self

from ...errors import StepError
from ...system import Array, Step

if TYPE_CHECKING:
    from ..run_state import RunState
    from ..step_map import StepMap


class EventError(StepError):
    """A failure that makes the last nodes of a run invalid.

    Attributes:
        node: the last valid node.
    """

    def __init__(self, status: str, message: str, node: int) -> None:
        self.node = node
        super().__init__(status, message)


class Occurrence(NamedTuple):
    """First event of a source in a step.

    Attributes:
        t: its time; the end of the step, or before.
        end: the step that leads there; None if the last step does, or if the event is at its start.
        singular: whether no step can begin there.
    """

    t: float
    end: Step | None = None
    singular: bool = False


class EventSource:
    """Source of events of a run; by default there are none."""

    each_step = False  # whether it must see every step: the stepper takes them one at a time

    @classmethod
    def of(cls, run: "RunState") -> Self | None:
        """Return the source of a run; None if the run does not need it.

        Raises:
            InputError: for options of the run that are not supported.
        """
        return cls()

    def start(self, run: "RunState", y: Array) -> Array:
        """Return the point from which the run continues, at its start or after a jump."""
        return y

    def begin(self, run: "RunState") -> None:
        """Begin a smooth interval at the last node."""

    def replace_step(self, run: "RunState") -> bool:
        """Proceed to another node without a step, and return True."""
        return False

    def rejects(self, step: "StepMap") -> bool:
        """Return whether a step is too long to detect events in it."""
        return False

    def first(self, step: "StepMap") -> Occurrence | None:
        """Return the first event in a step at which the source acts; None if there is none."""
        return None

    def act(self, run: "RunState") -> bool:
        """Continue the run after the event that was found last; return whether it ends there."""
        return False

    def truncated(self, run: "RunState") -> None:
        """Discard what was found after the last node."""

    def end(self, run: "RunState") -> None:
        """End a smooth interval at the last node."""

    def restart(self, run: "RunState", switched: bool) -> None:
        """Restart at the last node, after a jump or, in another mode, at the same time."""

    def results(self, run: "RunState") -> dict[str, Any]:
        """Return what was found up to the last node, as attributes of the solution."""
        return {}

    def statistics(self, run: "RunState") -> dict[str, Any]:
        """Return entries of the solution's statistics."""
        return {}

    def warning(self) -> str:
        """Return a warning to append to the message of the run; empty if there is none."""
        return ""

    def release(self) -> None:
        """Release the workspaces of the source."""

    def finish(self, run: "RunState") -> None:
        """Check a run that has completed.

        Raises:
            StepError: if it cannot be trusted.
        """

    def explain(self, run: "RunState", reason: StepError) -> StepError:
        """Return a failure, with more information if the source has any."""
        return reason
