"""The solution of a run, with its statistics and warnings."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import StepError
from ...solution.solution import Problem, Solution
from ...system import Array
from .elastic_resolution import amplified_vibrations, find_vibrations, limiting_vibration
from .run_diagnostics import accuracy_warnings
from .run_state import RunState

DIVERGED = ("singular", "rank", "nonfinite", "newton", "chart")  # statuses of runs that may have diverged
log = logging.getLogger("mbdae")


def make_solution(run: RunState, problem: Problem, status: str, message: str, seconds: float) -> Solution:
    """Return the solution of a run at the requested times; the accuracy of a finished run is checked.

    Args:
        run: the run.
        problem: the problem that is recorded with the solution.
        status: one of `mbdae.errors.STATUS`.
        message: description of the status.
        seconds: computing time in s.
    """
    stats = _statistics(run, seconds)
    message = "; ".join([message, *(text for source in run.sources if (text := source.warning()))])
    settings = {**run.settings, **run.stepper.settings(), "dense_order": run.dense_order}
    results = _results(run)
    full = Solution(problem, *run.nodes(), status, message, stats, settings, **results)
    out = full if run.options.t_eval is None else _at_times(full, run.options.t_eval, run.sign, results)
    if out.success and (system := run.mechanism_system):
        vibrations = find_vibrations(full)
        if warnings := accuracy_warnings(full, system, vibrations):
            event = f" ({out.message})" if status == "event" else ""
            out.status, out.message = "doubtful", f"{warnings}{event}"
        elif vibrations and (limit := limiting_vibration(full, vibrations)):
            out.message = f"{out.message}; {limit}"
    elif run.mechanism_system and status in DIVERGED and (why := amplified_vibrations(full)):
        out.message = f"{why} ({out.message})"
    log.info(
        "%s: %s, %s steps by %s (%s back end), %.3g s: %s",
        problem.title, out.status, stats["steps"], settings["method"], stats["backend"], seconds, out.message,
    )  # fmt: skip
    return out


def _statistics(run: RunState, seconds: float) -> dict[str, Any]:
    stats: dict[str, Any] = {"steps": run.steps, "rejected": run.rejected, **run.system.counts.to_dict()}
    stats |= {"seconds": seconds, "backend": run.stepper.backend}
    if run.mechanism_system:
        stats["drift"] = float(run.mechanism_system.largest_g)
    if run.fallback:
        stats["fallback"] = run.fallback
    for source in run.sources:
        stats |= source.statistics(run)
    return stats


def _results(run: RunState) -> dict[str, Any]:
    """Return rows in use and carries up to the last node, and the results of the sources of events."""
    n = len(run.ts)
    out: dict[str, Any] = {"in_use": [(i, rows) for i, rows in run.in_use if i < n]}
    out["carried"] = run.carries.up_to(n - 1)
    if run.mechanism_system:
        states = run.mechanism_system.laws.external_states(run.mechanism_system.element_states(run.ys[n - 1]))
        out["external"] = {name: x for name, x in states.items() if x}
    for source in run.sources:
        out |= source.results(run)
    return out


def _at_times(full: Solution, times: Array, sign: float, results: dict[str, Any]) -> Solution:
    """Interpolate a solution at the times that the run reached."""
    t, y, z = full.nodes
    status, message, computed = full.status, full.message, list[Array]()
    reached = times[(times - t[-1]) * sign <= 0]
    try:
        for point in full.points(reached):
            computed.append(point)
    except StepError as e:  # forces may fail at the end of a step, where some methods have no stage
        if full.success:
            status, message = e.status, f"the solution cannot be evaluated at t_eval: {e}"
    reached, points = reached[: len(computed)], np.array(computed).reshape(len(computed), y.shape[1])
    columns = [np.interp(sign * reached, sign * t, column) for column in z.T]
    own = np.array(columns).T.reshape(len(reached), z.shape[1])
    settings = full.settings
    return Solution(full.problem, reached, points, own, status, message, full.stats, settings, (t, y, z), **results)


def joined(parts: Sequence[Solution]) -> Solution:
    """Join successive parts of a run, each of which begins at the last node of the previous part, to one solution."""
    last = parts[-1]
    if len(parts) == 1:
        return last
    first = np.cumsum([0, *(len(part.t) - 1 for part in parts)]).tolist()
    tables: dict[str, Any] = {name: _nodes([getattr(part, name) for part in parts]) for name in ("t", "y", "z_own")}
    tables["t"][first[1:-1]] = [part.t[0] for part in parts[1:]]  # just before a jump at this node
    tables |= {name: [x for part in parts for x in getattr(part, name)] for name in ("impacts", "singular")}
    tables |= {name: _changes(first, [getattr(part, name) for part in parts]) for name in ("in_use", "modes")}
    tables["resets"] = [(k + i, name) for k, part in zip(first, parts, strict=False) for i, name in part.resets]
    tables["events"] = [_zeros(hits) for hits in zip(*(part.events for part in parts), strict=True)]
    stats = last.stats | _sums([part.stats for part in parts])
    if "drift" in stats:
        stats["drift"] = max(part.stats["drift"] for part in parts)
    return replace(last, settings=parts[0].settings, stats=stats, carried=None, **tables)


def _sums(parts: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Return the sums of the counts in statistics."""
    return {name: sum(part[name] for part in parts) for name, x in parts[0].items() if type(x) is int}


def _zeros(parts: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Join times and points of the zeros of an event from successive parts."""
    times, points = zip(*parts, strict=True)
    return np.concatenate(times), np.concatenate(points)


def _nodes(parts: Sequence[Array]) -> Array:
    """Join the rows of successive arrays, each of which begins with the last row of the previous array."""
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def _changes(first: Sequence[int], parts: Sequence[Sequence[tuple[int, Any]]]) -> list[tuple[int, Any]]:
    """Join changes of a value (node, new value) from parts that begin at the nodes ``first``, without repetitions."""
    out: list[tuple[int, Any]] = []
    for k, part in zip(first, parts, strict=False):
        seam = bool(out and part and out[-1][1] == part[0][1])
        out += [(k + at, x) for at, x in part[seam:]]
    return out
