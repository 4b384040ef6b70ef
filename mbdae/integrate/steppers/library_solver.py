"""Solvers of other libraries, with their own step-size control, and the base class of their steppers."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ...errors import StepError
from ...system import Array, State, Step, System
from .adaptive import Adaptive

if TYPE_CHECKING:
    from ..run.run_state import RunState

UNCONTROLLED = 1e30  # absolute tolerance of components whose error is not controlled


@dataclass(frozen=True)
class LibrarySolver(ABC):
    """A solver of another library.

    Attributes:
        name: its name.
        order: its order; the largest order if it is variable.
    """

    name: str
    order: int

    family: ClassVar[str] = "library"
    excludes: ClassVar[Mapping[str, str]] = {}
    in_core = True  # the compiled core evaluates its equations
    error_power = 1  # positive: it controls its step sizes

    @property
    def missing(self) -> str:
        """Why the library cannot be used; empty if it can."""
        return ""

    @property
    def order_linear(self) -> int:
        """Order for mechanisms."""
        return self.order

    @abstractmethod
    def stepper(
        self,
        system: System,
        rtol: float,
        atol: float | Array | None,
        first_step: float | None,
        max_step: float,
    ) -> "LibraryStepper":
        """Return the stepper of a run."""


class LibraryStepper(Adaptive):
    """Steps that a solver has already accepted; the solver defines the meaning of rtol and atol.

    Args:
        method: the solver.
        system: a workspace.
        rtol: relative tolerance.
        atol: absolute tolerance, a number or one for each component of (q, v).
        first_step: first step in s; None for the estimate of the solver.
        max_step: largest step in s.
    """

    any_size = False

    def __init__(
        self,
        method: LibrarySolver,
        system: System,
        rtol: float,
        atol: float | Array | None,
        first_step: float | None,
        max_step: float,
    ) -> None:
        super().__init__(method.order + 1, rtol, atol, first_step, max_step)
        self.solver: Any = None

    @property
    def control(self) -> None:
        return None

    @abstractmethod
    def propose(self, run: "RunState") -> tuple[float, float]:
        """Let the solver take a step; return its size and end time.

        Raises:
            StepError: if the solver fails.
        """

    def error(self, run: "RunState", step: Step) -> float:
        """Return 0: the solver has accepted its step."""
        return 0.0

    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return False: the solver chooses its steps."""
        return False

    def accept_or_reject(self, run: "RunState", h: float, error: float) -> bool:
        """Return True: the solver has accepted its step."""
        return True

    def first_size(self, run: "RunState") -> float | None:
        """Return the size of the first step of a smooth interval; None for the estimate of the solver."""
        return None if self.h is None else min(self.h, run.time_to_interval_end())

    def end_of_step(self, y: Array, z: Array) -> Step:
        """Return a step without errors."""
        return Step(State(y), z, np.zeros((0, len(y))))
