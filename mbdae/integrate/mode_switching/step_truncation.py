"""Truncation of a step at the end of a mode."""

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...mechanism.hybrid.switch import Guard
from ...system import State, Step
from ..step_map import StepMap

if TYPE_CHECKING:
    from ..run import RunState


def reject_unresolved_step(run: "RunState", start: State | None) -> bool:
    """Undo the last step if it does not resolve the loads of sticking rows, and return True."""
    if not run.modes or start is None or not run.modes.unresolved_step(run, StepMap(run, start)):
        return False
    run.stepper.take_back()
    run.take_back(start)
    run.rejected = (run.rejected or 0) + 1
    return True


def truncate_at_guard(run: "RunState", start: State | None) -> list[Guard]:
    """Truncate the last step where the first guards pass zero, and return these; the run is moved to that point.

    Args:
        run: the run, at the end of the step.
        start: the state at the start of the step; None for a singularity crossing.
    """
    assert run.modes
    step = StepMap(run, start)
    try:
        theta, fired = run.modes.check(run, step)
    except StepError:  # a guard cannot be computed: the run ends before
        run.take_back(start or State(step.y))
        raise
    if not fired or theta >= 1:
        return fired
    at, taken, t = start or State(step.y), None, step.t + theta * step.h
    if theta > 0 and t != step.t:
        if start and run.stepper.any_size:
            with suppress(StepError):
                taken = step.take(theta)
        if taken is None:
            taken = Step(State(step.point(theta)), run.zs[-1], np.empty(0))
    run.stepper.take_back()
    run.take_back(at)
    if taken is not None:
        run.accept(t, taken)
    if run.singular:
        run.singular.cut(run)
    return fired
