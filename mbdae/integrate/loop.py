"""Time loop of both back ends: step, accept or reject, record, detect events.

Until the end of the span:

1. near a singular configuration, cross it (`mbdae.integrate.singularity_crossing`);
2. otherwise let the stepper advance: one step in Python, or many in the compiled core, which returns when Python is
needed: a singular configuration, an event function, a progress report;
3. detect events in the new steps, if the core has not; a terminal one ends the run;
4. at the end of a smooth interval, restart after the jump, if the core has not.

On both back ends, each step is proposed, taken, compared with the tolerance, projected onto the closures if the run
projects, and accepted or rejected; then the rows of the next one are chosen
(`mbdae.system.System.update_independent_rows`).
"""

from collections.abc import Callable

import numpy as np

from ..errors import STATUS, InputError, StepError
from ..mechanism.formulations.index2 import Index2System
from ..mechanism.formulations.projection import refuse_contradicting_accelerations
from ..mechanism.hybrid.switches import describe_mode
from ..solution.solution import Problem
from .mode_switching.step_truncation import reject_unresolved_step, truncate_at_guard
from .run import RunState
from .singularity_crossing import KNOWN
from .step_map import StepMap
from .termination import drop_later_events, terminate_at_event

Progress = Callable[[float], None]


def run_to_end(run: RunState, max_steps: int | None, progress: Progress | None) -> tuple[str, str]:
    """Run to the end of the span or as far as possible; return status and message.

    Raises:
        InputError: for a force that fails at the start.
    """
    t0 = run.t
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # a diverging run is reported by its status
            run.begin()
            run.events.begin(t0, run.state.y)
            stopped = time_loop(run, max_steps, progress)
            _check_drivers(run.problem, t0, run.t)
    except StepError as e:
        if e.status == "force" and len(run.ts) == 1:  # nothing was computed: an error in the law
            raise InputError(str(e)) from e
        if e.status in ("step_size", "max_steps"):  # possibly caused by drivers
            try:
                _check_drivers(run.problem, t0, run.t1)
                _check_accelerations(run)
            except StepError as wrong:
                e = wrong
        return e.status, _failure_message(run, e)
    except KeyboardInterrupt:
        return "interrupted", f"{STATUS['interrupted']} at t = {run.t:.6g}"
    if stopped:
        return "event", f"{STATUS['event']} at t = {run.t:.17g}"
    asked = run.settings["t_span"][1]
    words = "" if run.t == asked else next((x for d in run.problem.drivers if (x := d.outside(asked))), "")
    return ("driver", words) if words else ("finished", STATUS["finished"])


def _failure_message(run: RunState, e: StepError) -> str:
    """Return why a run stopped; for a run with modes also when, and in which of them."""
    if not run.modes:
        return str(e)
    last = run.ts[-1], run.ys[-1]
    if run.singular and run.singular.next_to(*last) and (met := run.modes.touching(*last, KNOWN)):
        names = " and ".join(repr(name) for name in met) + (" is" if len(met) == 1 else " are")
        order = "the order of the two is beyond what its place is known to"
        return f"{names} met within {KNOWN:g} rad or characteristic lengths of a singular configuration: {order} ({e})"
    when = "" if "t = " in str(e) else f", at t = {run.t:.17g}"
    mode = (
        f" ({describe_mode(run.modes.switches, run.modes.system.mode)})"
        if e.status in ("step_size", "singular")
        else ""
    )
    return f"{e}{when}{mode}"


def time_loop(run: RunState, max_steps: int | None = None, progress: Progress | None = None) -> bool:
    """Step to the end of the span; True if a terminal event stopped the run before."""
    total, events = run.time_left(), run.events
    while run.time_left() > 0:
        left = None if max_steps is None else max_steps - run.steps - (run.rejected or 0)
        if left is not None and left <= 0:
            raise StepError("max_steps", f"{max_steps} steps did not suffice, stopped at t = {run.t:.17g}")
        before, start = len(run.ts), run.state
        events.looked = False
        began = None if run.singular is not None and run.singular.cross_if_near(run) else start
        if began:
            run.stepper.advance(run, 1 if run.modes or not events.by_signal else left)
        if len(run.ts) == before or reject_unresolved_step(run, began):
            continue
        if run.stiffness:
            run.stiffness.check(run)
        if events.stopped:
            drop_later_events(run)
            return True
        fired = truncate_at_guard(run, began) if run.modes else []
        if run.modes and run.singular and began and len(run.ts) > before:
            run.singular.step(run, run.time_left() == 0, bool(fired))
        if events.events and not events.looked:
            step = StepMap(run, began)
            stop = events.step(step)
            if stop:
                terminate_at_event(step, *stop)
                return True
        if run.modes and fired and run.time_left() > 0:
            run.modes.change_mode(run, fired)
        if run.t == run.leg.end and run.leg.restart is not None:
            run.cross(run.leg.restart)
            if run.modes and (fired := run.modes.violated_guards(run.t, run.ys[-1])):
                run.modes.change_mode(run, fired)
        if progress:
            progress(1 - run.time_left() / total)
    return False


def _check_drivers(problem: Problem, t0: float, t1: float) -> None:
    """Check the derivatives of drivers against their functions."""
    for driver in problem.drivers:
        driver.check_run(t0, t1)


def _check_accelerations(run: RunState) -> None:
    """See that the drivers of a mechanism do not contradict closures or each other where a run ends early."""
    if isinstance(run.system, Index2System):
        refuse_contradicting_accelerations(run.system, run.t, run.ys[-1])
