"""Steps of one size."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, StepError
from ...system import Array, Step
from ...tolerances import COINCIDENT, HALF_DIGITS, SOLUTION_ROUNDING, TINY
from .stepper import PythonStepper, smallest

if TYPE_CHECKING:
    from ..run_state import RunState

DETOUR = (0.309, 0.655)  # of two steps, of which the end of the first cannot be stepped on
TOLERATED = HALF_DIGITS  # of the magnitude of a component: largest move of the state when steps are fixed


class Fixed(PythonStepper):
    """Steps of equal size on a grid; those before and after jumps and at the end of the span may be shorter."""

    def __init__(self, step: float, t0: float, t1: float) -> None:
        if abs(t1 - t0) > 0 and step < smallest(t0, t1):
            raise InputError(f"step = {step} s is below {smallest(t0, t1):.1e} s, where t + h rounds to t")
        self.step, self.t0, length = step, t0, abs(t1 - t0)
        self.n = max(1, int(np.ceil(length / step * (1 - SOLUTION_ROUNDING))))
        self.i, self.on_grid = 0, True  # the last grid point, and whether the run is at it
        self.detour: list[float] = []  # times of the next steps off the grid
        self.aside: float | None = None  # time of the last one, if it was off the grid

    def propose(self, run: "RunState") -> tuple[float, float]:
        """Return the size of the next step and the time where it ends."""
        if self.detour:
            t = self.aside = self.detour.pop(0)
            return abs(t - run.t), t
        self.aside = None
        i, started = self.i + 1, self.on_grid
        t = run.t1 if i >= self.n else self.t0 + run.sign * i * self.step
        beyond = run.sign * (t - run.leg.stop)  # the interval ends before the next grid point
        self.on_grid = beyond <= COINCIDENT * self.step
        self.i += self.on_grid
        if beyond >= -COINCIDENT * self.step:
            return run.left(), run.leg.end
        return (self.step if started else abs(t - run.t)), t

    def take(self, run: "RunState", h: float) -> Step:
        """Take a step of size h (signed)."""
        step = run.tableau.step(run.system, run.t, h, run.state)
        if run.singular and self._behind(run) is not None:
            run.singular.reject_singular_step(run.t + h, step.state.y)
        return step

    def error(self, run: "RunState", step: Step) -> float:
        """Return the error norm of a step; it is accepted below 1."""
        if not np.isfinite(step.state.y).all():
            raise StepError("nonfinite", f"the state is not finite after the step at t = {run.t:.17g}")
        return 0.0

    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return whether to skip the next grid point, because it is a singular configuration.

        Three steps then lead to the grid point after it.
        """
        end = self._behind(run) if reason.status in ("rank", "singular") else None
        if end is None:
            return False
        self.i += 1
        self.detour = [run.t + share * (end - run.t) for share in DETOUR] + [end]
        return True

    def _behind(self, run: "RunState") -> float | None:
        """Return the grid point after the next one; None if the latter cannot be skipped."""
        if self.detour or not self.on_grid or self.i >= self.n:
            return None
        end = run.t1 if self.i + 1 == self.n else self.t0 + run.sign * (self.i + 1) * self.step
        return end if run.sign * (run.leg.stop - end) >= 0 else None

    def judge(self, run: "RunState", h: float, error: float) -> bool:
        """Return whether a step is accepted, and choose the next step size."""
        return True

    def take_back(self) -> None:
        """The last step was truncated: the next one leads to its original end."""
        if self.aside is not None:
            self.detour.insert(0, self.aside)
            return
        self.i -= self.on_grid
        self.on_grid = False

    def measure(self, run: "RunState", y: Array, move: Array) -> float:
        """Return the largest component of a move of the state away from y, in tolerances of `TOLERATED`."""
        m = run.system.measured
        return float((np.abs(move) / (TOLERATED * run.system.magnitude(y) + TINY))[m].max(initial=0.0))

    def ready(self, run: "RunState") -> bool:
        """Return whether the compiled core may take the next steps: on the grid only."""
        if not self.detour:
            self.aside = None
        return not self.detour

    def settings(self) -> dict[str, Any]:
        """Return the settings that are recorded with the solution."""
        return {"step": float(self.step)}
