"""The only time loop: step, accept or reject, record, look for events."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ..errors import StepError
from .ending import end_in_event
from .events import Watch
from .run import Run
from .steppers.pace import Pace

Progress = Callable[[float], None]


def time_loop(run: Run, pace: Pace, watch: Watch, max_steps: int | None, progress: Progress | None) -> bool:
    """Step to the end of the span; True when a terminal event stopped the run before."""
    total = run.to_go()
    while run.to_go() > 0:
        left = None if max_steps is None else max_steps - run.steps - (run.rejected or 0)
        if left is not None and left <= 0:
            raise StepError("max_steps", f"{max_steps} steps did not suffice, stopped at t = {run.t:.17g}")
        before, start = len(run.ts), run.state
        leapt = run.singular is not None and run.singular.leap(run)
        if not leapt and not (run.core and run.core.advance(run, pace, 1 if watch.events else left)):
            one_step(run, pace)
        if len(run.ts) == before:
            continue
        if run.stiffness:
            run.stiffness.look(run)
        if watch.events:
            h = run.t - run.ts[-2]
            at = partial(run.singular.along, h) if run.singular and leapt else run.record().dense(len(run.ts) - 2)
            stop = watch.step(run.ts[-2], h, at)
            if stop:
                end_in_event(run, pace, watch, None if leapt else start, at, *stop)
                return True
        if run.t == run.leg.end and run.leg.restart is not None:
            run.cross(run.leg.restart)
            pace.restart()
            if run.singular:
                run.singular.restart(len(run.ts) - 1)
            if run.stiffness:
                run.stiffness.restart(len(run.ts) - 1)
        if progress:
            progress(1 - run.to_go() / total)
    return False


def one_step(run: Run, pace: Pace) -> None:
    """Take one step and accept or reject it."""
    if run.singular:
        run.singular.begin_step()
    h, t_next = pace.propose(run)
    try:
        step = pace.take(run, run.sign * h)
        error = pace.error(run, step)
        if run.project and error <= 1:
            step = step._replace(state=run.restored(t_next, step.state))
    except StepError as e:
        if not pace.may_retry(run, h, e):
            raise
        step, error = None, np.inf
    if step is None or not pace.judge(run, h, error):
        run.rejected = (run.rejected or 0) + 1
        return
    run.accept(t_next, step)
    if run.singular:
        run.singular.step(run, run.to_go() == 0)
