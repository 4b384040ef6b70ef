"""Record of the inputs that FMUs set in a run."""

from typing import TYPE_CHECKING, Any

from ...mechanism.inputs import Inputs
from .source import EventSource

if TYPE_CHECKING:
    from ..run.run_state import RunState


class InputRecord(EventSource):
    """The inputs that FMUs set in a run, recorded as functions of time in the mechanism of its solution.

    It has no events.

    Args:
        inputs: those of the mechanism.
    """

    def __init__(self, inputs: Inputs) -> None:
        self.inputs = inputs

    @classmethod
    def from_run(cls, run: "RunState") -> "InputRecord | None":
        return cls(run.inputs) if run.inputs else None

    def results(self, run: "RunState") -> dict[str, Any]:
        return {"problem": self.inputs.recorded(*run.nodes()[:2])}
