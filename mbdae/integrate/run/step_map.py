"""The last step of a run as a function of theta in [0, 1]: by shorter steps of the method, and by dense output."""

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...system import Array, State, Step

if TYPE_CHECKING:
    from .run_state import RunState


class StepMap:
    """The last step of a run.

    Args:
        run: the run, at the end of the step.
        start: the state at the start of the step; None for a singularity crossing, which cannot be repeated as a step.
        ends: whether an event occurs at the end of the step.

    Attributes:
        t, h: start time and signed size of the step.
        t1: end of the step.
        y, y1: the points at t and t1, (n,).
        first: whether it is the first step of the run.
    """

    def __init__(self, run: "RunState", start: State | None, ends: bool = False) -> None:
        self.run, self.start, self.ends, self.node = run, start, ends, len(run.ts) - 2
        self.t, self.t1 = run.ts[-2], run.ts[-1]
        self.h, self.y, self.y1, self.first = self.t1 - self.t, run.ys[-2], run.ys[-1], self.node == 0
        self._cache = {0.0: self.y, 1.0: self.y1}

    def ended_by_event(self) -> "StepMap":
        """Return the same step, marked as ending at an event."""
        return StepMap(self.run, self.start, True)

    def dense(self, theta: float) -> Array:
        """Return y (n,) at t + theta h by dense output, one order below the method; values are cached."""
        if theta not in self._cache:
            self._cache[theta] = self._interpolant(theta)
        return self._cache[theta]

    @cached_property
    def _interpolant(self) -> Callable[[float], Array]:
        run = self.run
        if run.singularity_monitor and self.start is None:
            return partial(run.singularity_monitor.crossing_point, self.h)
        return run.partial_solution().dense(self.node)

    def rates(self) -> tuple[Array, Array]:
        """Return y' (ny,) at both ends."""
        return self.run.partial_solution().rate(self.node), self.run.partial_solution().rate(self.node + 1)

    def point(self, theta: float) -> Array:
        """Return y (n,) at the end of a step of size theta h; on the dense output if that step fails."""
        if self.start is not None and self.run.stepper.any_size:
            with suppress(StepError):
                return self.take(theta).state.y
        return self.dense(theta)

    def end(self, theta: float) -> Step:
        """Return the step of size theta h; if it fails, its end is on the dense output."""
        if self.start and self.run.stepper.any_size:
            with suppress(StepError):
                return self.take(theta)
        return Step(State(self.point(theta)), self.run.zs[-1], np.empty(0))

    def take(self, theta: float) -> Step:
        """Return a step of size theta h from the same start, with the projection of the run; the run is unchanged.

        Raises:
            StepError: if the step fails.
        """
        run, system = self.run, self.run.system
        saved, rows, rows_of_step = (run.t, run.state), system.in_use, run.rows_at(self.node)
        run.t, run.state = self.t, self.start or State(self.y)
        try:
            if rows_of_step != rows:
                system.use_rows(rows_of_step)
            if run.singularity_monitor:
                run.singularity_monitor.begin_step()
            step = run.stepper.take(run, theta * self.h)
            if run.project:
                step = step._replace(state=run.projected(self.t + theta * self.h, step.state))
            return step
        finally:
            run.t, run.state = saved
            if rows_of_step != rows:
                system.use_rows(rows)
