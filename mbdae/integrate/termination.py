"""End of a run: termination at an event, and the resulting solution."""

from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from ..errors import StepError
from ..mechanism.callbacks import called, checked, function_name
from ..mechanism.formulations.index2 import Index2System
from ..solution.solution import Solution
from ..system import Array, State, Step, System
from .events import Event
from .run import RunState
from .run_diagnostics import accuracy_warnings
from .step_map import StepMap


def terminate_at_event(at: StepMap, theta: float, event: Event) -> None:
    """Terminate at an event with a step of the method, so that closures are satisfied as at any other node.

    If no shorter step succeeds, the end is the point of the dense output, projected onto the closures. It is not
    projected with scipy's solvers, whose nodes do not satisfy the closures either, in a singularity crossing, or next
    to a singular configuration, where a step or a projection would rotate velocities.

    Args:
        at: the step that contains the event.
        theta: position of the event in the step.
        event: the event.
    """
    run, t, h, start, step = at.run, at.t, at.h, at.start, None
    if run.singular and run.singular.beside(t + theta * h, at.dense(theta)):
        start = None
    if start and run.stepper.any_size:
        with suppress(StepError):
            if theta == 0:
                step = Step(start, run.zs[at.node], np.empty(0))
            elif isinstance(event.function, str):
                step = at.take(theta)
            else:
                theta, step = run.events.land(event, theta, t, h, at.dense, at.take)
    if step is None and start:
        y = run.system.restore(t + theta * h, at.dense(theta)) if run.stepper.any_size else at.dense(theta)
        step = Step(State(y), run.system.derivative(t + theta * h, y)[1], np.empty(0))
    there = at.dense(theta) if step is None else step.state.y
    run.take_back(start or State(at.y))
    if step is None:
        run.land(t + theta * h, there, last=True)
    elif t + theta * h != t:
        run.accept(t + theta * h, step)
    drop_later_events(run)


def drop_later_events(run: RunState) -> None:
    """Drop events after the end of a run."""
    if run.singular:
        run.singular.cut(run)
    run.events.end(run.t, run.ys[-1], run.sign)


def make_solution(run: RunState, status: str, message: str, seconds: float, times: Array | None) -> Solution:
    """Make the solution of a run, at the requested times; accuracy checks are applied to a finished run."""
    stats: dict[str, Any] = {"steps": run.steps, "rejected": run.rejected, **run.system.counts.to_dict()}
    stats |= {"seconds": seconds, "backend": run.stepper.backend}
    if run.fallback:
        stats["fallback"] = run.fallback
    if run.events.events:
        stats["events"] = run.stepper.backend if run.events.by_signal else f"python: {run.events.why_python}"
    if run.stiffness and run.stiffness.found:
        stats["stiff"] = asdict(run.stiffness.found)
        message = f"{message}; {run.stiffness.found}"
    settings = {**run.settings, **run.stepper.settings(), "dense_order": run.dense_order}
    n = len(run.ts)
    t, y, z = np.array(run.ts), run.ys[:n].copy(), run.zs[:n].copy()
    hits = [[(w, p) for w, p in hits if (w - t[-1]) * run.sign <= 0] for hits in run.events.found]
    shape = y.shape[1:]
    found = [(np.array([w for w, _ in x], float), np.array([p for _, p in x]).reshape(-1, *shape)) for x in hits]
    passed = run.singular.found if run.singular else []
    rows = [(i, rows) for i, rows in run.in_use if i < n]
    rest: dict[str, Any] = {"events": found, "singular": passed, "in_use": rows}
    rest["carried"] = run.carried.of(n)
    if run.modes:
        rest |= {"modes": [(i, mode) for i, mode in run.modes.modes if i < n], "impacts": run.modes.impacts}
        stats |= {"transitions": len(run.modes.modes) - 1, "impacts": len(run.modes.impacts)}
    full = Solution(run.problem, t, y, z, status, message, stats, settings, **rest)
    if full.success and isinstance(run.system, Index2System) and (words := accuracy_warnings(full, run.system)):
        full.status, full.message = status, message = "doubtful", words
    if times is None:
        return full
    reached = times[(times - t[-1]) * run.sign <= 0]
    read: list[Array] = []
    try:
        for point in full.points(reached):
            read.append(point)
    except StepError as e:  # the end of a step without a stage there may lie where forces fail
        if full.success:
            status, message = e.status, f"t_eval cannot be read: {e}"
    reached, points = reached[: len(read)], np.array(read).reshape(len(read), y.shape[1])
    own = np.array([np.interp(run.sign * reached, run.sign * t, column) for column in z.T]).T.reshape(
        len(reached), z.shape[1]
    )
    return Solution(run.problem, reached, points, own, status, message, stats, settings, (t, y, z), **rest)


def event_value(system: System, event: Event, t: float, y: Array) -> float:
    """Evaluate an event function.

    Raises:
        StepError: if it fails or does not return a finite number.
    """
    assert callable(event.function)
    what = f"event {function_name(event.function)!r}"
    return float(checked(called(what, event.function, t, *system.split(y)), (), t, what))
