"""Time loop of both back ends: step, accept or reject, record, detect events.

Until the end of the span:

1. the stepper advances: one step in Python, or many in the compiled core, which returns when Python is needed (a
singular configuration, an event function, a progress report); alternatively, a source of events replaces the step, to
cross a singular configuration;
2. each source of events returns its first event in the last step (`mbdae.integrate.events.source`);
3. the source of the earliest event handles it: the run ends, or continues in another mode or after a jump.

On both back ends, a step is proposed and taken, its error is compared with the tolerance, its end is projected onto the
closures if the run projects, and the step is accepted or rejected; then the rows of the next step are selected
(`mbdae.system.System.update_independent_rows`).
"""

from collections.abc import Callable

import numpy as np

from ...errors import STATUS, InputError, StepError
from ...system import State
from ..events.source import EventError, EventSource
from .run_state import RunState
from .step_map import StepMap

Progress = Callable[[float], None]


def run_to_end(run: RunState, progress: Progress | None) -> tuple[str, str]:
    """Run to the end of the span or as far as possible; return status and message.

    Raises:
        InputError: for a force that fails at the start, or options that a source of events does not support.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging run is reported by its status
        try:
            if not run.sources and _complete(run, progress):
                return "finished", STATUS["finished"]
            run.begin(ahead=True)
            stopped = time_loop(run, progress)
            for source in run.sources:
                source.finish(run)
        except StepError as e:
            if isinstance(e, EventError):
                run.drop_nodes_after(e.node)
            if e.status == "force" and len(run.ts) == 1:  # no step was taken: the law itself is wrong
                raise InputError(str(e)) from e
            for source in run.sources:
                e = source.explain(run, e)
            return e.status, str(e)
        except KeyboardInterrupt:
            return "interrupted", STATUS["interrupted"]
    if stopped:
        run.jumps.drop_sampling(run)
        return "event", f"{STATUS['event']}: {', '.join(run.user_events.names_at(run.t))}"
    t1 = run.options.t1
    undefined = "" if run.t == t1 else next((x for d in run.problem.drivers if (x := d.outside(t1))), "")
    return ("driver", undefined) if undefined else ("finished", STATUS["finished"])


def _complete(run: RunState, progress: Progress | None) -> bool:
    """Complete a run without sources of events in one call of the core; if that is impossible, add its sources."""
    if not run.stepper.complete(run):
        run.add_sources()
        return False
    if progress:
        progress(1.0)
    return True


def time_loop(run: RunState, progress: Progress | None = None) -> bool:
    """Step to the end of the span; return True if an event stopped the run earlier."""
    total = run.time_left()
    while run.time_left() > 0:
        before = len(run.ts)
        start = _advance(run)
        handlers = _detect_events(run, start, before) if len(run.ts) > before else None
        if handlers is None:  # no step was taken, or the last one was rejected
            continue
        ended = False
        for source in handlers:
            ended |= source.handle_event(run, ended)
        if ended:
            return True
        if progress:
            progress(1 - run.time_left() / total)
    return False


def _advance(run: RunState) -> State | None:
    """Try one or several steps; return the state at the start of the last step, None if a source replaced the step.

    Raises:
        StepError: if the largest number of steps is reached.
    """
    max_steps = run.options.max_steps
    remaining = None if max_steps is None else max_steps - run.steps - (run.rejected or 0)
    if remaining is not None and remaining <= 0:
        raise StepError("max_steps", f"{max_steps} steps did not suffice")
    start = run.state
    if any(source.replace_step(run) for source in run.sources):
        return None
    run.stepper.advance(run, 1 if any(source.each_step for source in run.sources) else remaining)
    return start


def _detect_events(run: RunState, start: State | None, before: int) -> list[EventSource] | None:
    """Truncate the last step at its earliest event; return the sources of the event, None if the step was rejected."""
    step, handlers = StepMap(run, start), list[EventSource]()
    if start and any(source.rejects(step) for source in run.sources):  # too long to detect its events
        run.reject_step(start)
        return None
    for source in run.sources:
        event = source.first_event(step)
        if event is None:
            continue
        if event.end is not None or event.t != step.t1:  # earlier than the previous events
            run.truncate(step, event)
            handlers.clear()
        handlers.append(source)
        if len(run.ts) == before:  # at the start of the step
            break
        step = step.ended_by_event()
    return handlers
