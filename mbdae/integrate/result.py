"""Solution of a run."""

from dataclasses import asdict
from typing import Any

import numpy as np

from ..errors import StepError
from ..mechanism.formulations.index2 import Index2System
from ..solution.solution import Solution
from ..system import Array
from .run import RunState
from .run_diagnostics import accuracy_warnings


def make_solution(run: RunState, status: str, message: str, seconds: float, times: Array | None) -> Solution:
    """Make the solution of a run, at the requested times; accuracy checks are applied to a finished run."""
    stats = _statistics(run, seconds)
    if run.stiffness and run.stiffness.found:
        message = f"{message}; {run.stiffness.found}"
    settings = {**run.settings, **run.stepper.settings(), "dense_order": run.dense_order}
    n = len(run.ts)
    t, y, z = np.array(run.ts), run.ys[:n].copy(), run.zs[:n].copy()
    found = _found(run, t, y.shape[1:])
    full = Solution(run.problem, t, y, z, status, message, stats, settings, **found)
    if full.success and isinstance(run.system, Index2System) and (words := accuracy_warnings(full, run.system)):
        full.status, full.message = "doubtful", words
    return full if times is None else _at_times(full, times, run.sign, found)


def _statistics(run: RunState, seconds: float) -> dict[str, Any]:
    stats: dict[str, Any] = {"steps": run.steps, "rejected": run.rejected, **run.system.counts.to_dict()}
    stats |= {"seconds": seconds, "backend": run.stepper.backend}
    if run.fallback:
        stats["fallback"] = run.fallback
    if run.events.events:
        stats["events"] = run.stepper.backend if run.events.by_signal else f"python: {run.events.why_python}"
    if run.stiffness and run.stiffness.found:
        stats["stiff"] = asdict(run.stiffness.found)
    if run.modes:
        stats |= {"transitions": len(run.modes.modes) - 1, "impacts": len(run.modes.impacts)}
    return stats


def _found(run: RunState, t: Array, shape: tuple[int, ...]) -> dict[str, Any]:
    """Return events, singular configurations, rows in use, carries, modes and impacts up to the last node."""
    n, events = len(t), []
    for hits in run.events.found:
        kept = [(when, point) for when, point in hits if (when - t[-1]) * run.sign <= 0]
        points = np.array([point for _, point in kept]).reshape(-1, *shape)
        events.append((np.array([when for when, _ in kept], float), points))
    found: dict[str, Any] = {"events": events, "singular": run.singular.found if run.singular else []}
    found |= {"in_use": [(i, rows) for i, rows in run.in_use if i < n], "carried": run.carried.of(n)}
    if run.modes:
        found |= {"modes": [(i, mode) for i, mode in run.modes.modes if i < n], "impacts": run.modes.impacts}
    return found


def _at_times(full: Solution, times: Array, sign: float, found: dict[str, Any]) -> Solution:
    """Interpolate a solution at the times that it reached."""
    t, y, z = full.nodes
    status, message, read = full.status, full.message, list[Array]()
    reached = times[(times - t[-1]) * sign <= 0]
    try:
        for point in full.points(reached):
            read.append(point)
    except StepError as e:  # the end of a step without a stage there may lie where forces fail
        if full.success:
            status, message = e.status, f"t_eval cannot be read: {e}"
    reached, points = reached[: len(read)], np.array(read).reshape(len(read), y.shape[1])
    columns = [np.interp(sign * reached, sign * t, column) for column in z.T]
    own = np.array(columns).T.reshape(len(reached), z.shape[1])
    return Solution(full.problem, reached, points, own, status, message, full.stats, full.settings, (t, y, z), **found)
