"""Interface between the time loop and the sources of events.

After each step, each source in turn detects its first event in the step; an event before the end of the step truncates
the step, so the next source checks the shorter step. The source of the earliest event handles it: it
ends the run, or continues it from another point or in another mode. In order, the sources are

1. `driver_checks`, at the end of the run only;
2. `mode_changes`: guards of contacts, stops, clutches and stiction;
3. `singularity`: singular configurations, which are crossed by extrapolation in place of a step;
4. `mbdae.integrate.run.stiffness_detection`, which warns only;
5. `user_events`: signals and functions; terminal events end the run;
6. `resets`: user-defined events at which the state jumps;
7. `jumps`: controllers, functions of time and times given by the user.

Sources read the run, and change it only by its methods. Hooks of a source: `adjust_point` and `begin_interval` at the
start of a smooth interval, `end_interval` at its end, and `after_discontinuity` at the first node after a jump or a
mode change.
"""

from typing import TYPE_CHECKING, Any, NamedTuple, Self

from ...data_types import JsonObject
from ...errors import StepError
from ...system import Array, Step

if TYPE_CHECKING:
    from ..run.run_state import RunState
    from ..run.step_map import StepMap


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
        t: time of the event, at the end of the step or before.
        end: the step that ends at t; None if it is the last step, or if the event is at the start of the step.
        singular: whether no step can begin at t.
    """

    t: float
    end: Step | None = None
    singular: bool = False


class EventSource:
    """Source of events of a run; by default without events."""

    is_needed = True  # whether it may have events in this run
    each_step = False  # whether it must check every step: the stepper then takes one step at a time

    @classmethod
    def from_run(cls, run: "RunState") -> Self | None:
        """Return the source for a run; None if the run does not need it.

        Raises:
            InputError: for options of the run that the source does not support.
        """
        return cls()

    def adjust_point(self, run: "RunState", y: Array) -> Array:
        """Return the point at which a smooth interval begins, given that of the node, at the start or after a jump."""
        return y

    def begin_interval(self, run: "RunState") -> None:
        """Begin a smooth interval at the last node."""

    def is_idle(self, run: "RunState", t1: float) -> bool:
        """Return whether the source need not check steps up to t1 that the core finds regular."""
        return not self.each_step

    def replace_step(self, run: "RunState") -> bool:
        """Return whether the source has appended a node in place of a step."""
        return False

    def rejects(self, step: "StepMap") -> bool:
        """Return whether a step is too long to detect events in it."""
        return False

    def first_event(self, step: "StepMap") -> Occurrence | None:
        """Return the first event of a step that the source must handle; None if there is none."""
        return None

    def handle_event(self, run: "RunState", ended: bool) -> bool:
        """Handle the last detected event; return whether it ends the run.

        Args:
            run: the run, at the event.
            ended: whether another source has just ended it at the same instant.
        """
        return False

    def discard_beyond_end(self, run: "RunState") -> None:
        """Discard events after the last node."""

    def end_interval(self, run: "RunState", node: int) -> None:
        """End a smooth interval at a node."""

    def after_discontinuity(self, run: "RunState", node: int, mode_changed: bool) -> None:
        """Update the source at the first node after a jump or, if ``mode_changed``, after a mode change."""

    def results(self, run: "RunState") -> dict[str, Any]:
        """Return results up to the last node, as attributes of the solution."""
        return {}

    def statistics(self, run: "RunState") -> JsonObject:
        """Return entries of the solution's statistics."""
        return {}

    def warning(self) -> str:
        """Return a warning to append to the message of the run; empty if there is none."""
        return ""

    def release(self) -> None:
        """Release the workspaces of the source."""

    def finish(self, run: "RunState") -> None:
        """Check a completed run.

        Raises:
            StepError: if the run is invalid.
        """

    def explain(self, run: "RunState", reason: StepError) -> StepError:
        """Return the reason for a failure, with additional information of the source."""
        return reason
