"""Steps of a fixed size."""

from typing import TYPE_CHECKING

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, StepError
from ...system import Array, Step
from ...tolerances import COINCIDENT, HALF_DIGITS, SOLUTION_ROUNDING, TINY
from .stepper import PythonStepper, StepperState, smallest_step

if TYPE_CHECKING:
    from ..run.run_state import RunState

DETOUR = (0.309, 0.655)  # fractions of two steps: ends of steps that avoid the grid point in between
FIXED_STEP_TOLERANCE = HALF_DIGITS  # fraction of the magnitude of a component: a larger projection restarts the carry


class Fixed(PythonStepper):
    """Steps of equal size on a grid; steps before and after jumps and at the end of the span may be shorter."""

    def __init__(self, step: float, t0: float, t1: float) -> None:
        if abs(t1 - t0) > 0 and step < smallest_step(t0, t1):
            raise InputError(f"step = {step} s is below {smallest_step(t0, t1):.1e} s, where t + h rounds to t")
        self.step, self.t0, length = step, t0, abs(t1 - t0)
        self.n = max(1, int(np.ceil(length / step * (1 - SOLUTION_ROUNDING))))
        self.i, self.on_grid = 0, True  # index of the last grid point, and whether the run is there
        self.detour: list[float] = []  # times of the next steps off the grid
        self.off_grid_time: float | None = None  # end time of the last step, if it is off the grid

    def propose(self, run: "RunState") -> tuple[float, float]:
        """Return the size of the next step and its end time."""
        if self.detour:
            t = self.off_grid_time = self.detour.pop(0)
            return abs(t - run.t), t
        self.off_grid_time = None
        i, starts_on_grid = self.i + 1, self.on_grid
        t = run.t1 if i >= self.n else self.t0 + run.sign * i * self.step
        overshoot = run.sign * (t - run.interval.stop)  # time from the end of the interval to the next grid point
        self.on_grid = overshoot <= COINCIDENT * self.step
        self.i += self.on_grid
        remaining, end = run.time_to_interval_end(), run.interval.end
        if starts_on_grid and run.interval.stop == end and abs(remaining - self.step) <= 4 * np.spacing(abs(end)):
            return self.step, end  # rounding of times does not change steps
        if overshoot >= -COINCIDENT * self.step:
            return remaining, end
        return (self.step if starts_on_grid else abs(t - run.t)), t

    def take(self, run: "RunState", h: float) -> Step:
        """Take a step of size h (signed)."""
        step = run.tableau.step(run.system, run.t, h, run.state)
        if run.singularity_monitor and self._grid_point_after_next(run) is not None:
            run.singularity_monitor.reject_singular_step(run.t + h, step.state.y)
        return step

    def error(self, run: "RunState", step: Step) -> float:
        """Return 0, since every step is accepted.

        Raises:
            StepError: if the state is not finite.
        """
        if not np.isfinite(step.state.y).all():
            raise StepError("nonfinite", f"the state is not finite after the step at t = {run.t:.17g}")
        return 0.0

    def may_retry(self, run: "RunState", h: float, reason: StepError) -> bool:
        """Return whether to skip the next grid point, because it is a singular configuration.

        Three steps then lead to the second grid point.
        """
        end = self._grid_point_after_next(run) if reason.status in ("rank", "singular") else None
        if end is None:
            return False
        self.i += 1
        self.detour = [run.t + fraction * (end - run.t) for fraction in DETOUR] + [end]
        return True

    def _grid_point_after_next(self, run: "RunState") -> float | None:
        """Return the time of the second grid point ahead; None if the next grid point cannot be skipped."""
        if self.detour or not self.on_grid or self.i >= self.n:
            return None
        end = run.t1 if self.i + 1 == self.n else self.t0 + run.sign * (self.i + 1) * self.step
        return end if run.sign * (run.interval.stop - end) >= 0 else None

    def accept_or_reject(self, run: "RunState", h: float, error: float) -> bool:
        """Return whether a step is accepted, and choose the next step size."""
        return True

    def undo_step(self) -> None:
        """Undo the last step, which was truncated: the next step leads to the original grid point."""
        if self.off_grid_time is not None:
            self.detour.insert(0, self.off_grid_time)
            return
        self.i -= self.on_grid
        self.on_grid = False

    def tolerance_norms(self, run: "RunState", y: Array, displacements: Array) -> list[float]:
        """Return the largest components of displacements of the state from y, in units of `FIXED_STEP_TOLERANCE`."""
        scale, m = FIXED_STEP_TOLERANCE * run.system.characteristic_magnitudes(y) + TINY, run.system.error_components
        return (np.abs(displacements) / scale)[:, m].max(axis=1, initial=0.0).tolist()

    def ready_for_core(self, run: "RunState") -> bool:
        """Return whether the compiled core may take the next steps: only on the grid."""
        if not self.detour:
            self.off_grid_time = None
        return not self.detour

    def snapshot(self) -> StepperState:
        return self.i, self.on_grid, tuple(self.detour), self.off_grid_time

    def resume(self, snapshot: StepperState) -> None:
        self.i, self.on_grid, detour, self.off_grid_time = snapshot
        self.detour = list(detour)

    def settings(self) -> JsonObject:
        """Return the settings that are recorded with the solution."""
        return {"step": float(self.step)}
