"""Batches of runs of a sweep, for threads, processes and clusters.

Runs with outputs at the end alone are completed in the compiled core, if possible.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice, repeat
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from ...errors import STATUS, MbdaeError
from ...integrate.options.options import RunOptions
from ...integrate.run.core_runs import COUNTS, solve_in_core, supports_parameters_in_place
from ...integrate.run.run_setup import prepare_at
from ...integrate.run.run_state import RunState
from ...mechanism import Mechanism
from ..final_signals import signals_at_end, why_not_in_core
from ..varied_starts import Beginning, run_parameters
from ..workers import StopFlag, batch_size
from .outputs import label, parse
from .plan import Task, names
from .results_file import MORE, Row
from .sweep_run import Job, run, split

MAX_BATCH = 500  # runs
BATCH_SECONDS = 0.2  # of several runs in a batch: at least ten times what sending them to a cluster takes
LAST_RUNS = 8  # whose mean time determines the next batch
FINAL = "final"


class _Start(NamedTuple):
    """Start of a task, and its index in the batch."""

    i: int
    at: Beginning


class Batch(NamedTuple):
    """Tasks that one worker makes together."""

    tasks: Sequence[Task]

    def __str__(self) -> str:
        first, *others = self.tasks
        return f"batch of runs {first.run} to {others[-1].run}" if others else str(first)


def batches_of(plan: Sequence[Task], pending: int, seconds: dict[int, float]) -> Iterator[Batch]:
    """Yield the tasks in batches, see `batch_size`; they are short enough for a stop to lose little.

    Args:
        plan: the tasks.
        pending: number of batches that are submitted at a time.
        seconds: wall times of finished runs by number, the latest last; batches have one run until there are any.
    """
    i = 0
    while i < len(plan):
        last = list(islice(reversed(seconds.values()), LAST_RUNS))
        mean = sum(last) / len(last) if last else None
        longest = min(MAX_BATCH, max(1, int(BATCH_SECONDS / mean))) if mean else 1
        size = min(longest, batch_size(len(plan) - i, pending, mean))
        yield Batch(plan[i : i + size])
        i += size


def run_batch(job: Job, batch: Batch, stop: StopFlag | None = None) -> list[tuple[Row, float]]:
    """Return rows and wall times in s of several tasks; those that the core cannot complete are run one by one."""
    started, rows, flag = perf_counter(), dict[int, Row](), stop or StopFlag()
    if _ends_suffice(job):
        for settings, starts in _groups(job, batch.tasks):
            rows |= _completed(job, settings, batch.tasks, starts, flag)
    seconds = (perf_counter() - started) / max(1, len(rows))
    return [(rows[i], seconds) if i in rows else run(job, task, flag) for i, task in enumerate(batch.tasks)]


def _ends_suffice(job: Job) -> bool:
    """Return whether the core may complete the runs of a sweep: signals at their ends are all that is wanted."""
    final = all(isinstance(x, str) and parse(x).reduction == FINAL for x in job.outputs)
    return final and job.times is None and not job.settings.get("events")


def _groups(job: Job, tasks: Sequence[Task]) -> list[tuple[dict[str, Any], list[_Start]]]:
    """Return settings and starts of tasks whose mechanisms differ in their starts alone.

    They end at the first task that needs Python, since those after it most likely do, too.
    """
    found, group = dict[tuple, tuple[dict[str, Any], list[_Start]]](), list[_Start]()
    last: tuple[Mechanism, str] | None = None  # of this group
    values, all_settings = zip(*(split(task.values, job.factory, task.seed) for task in tasks), strict=True)
    for i, (made, settings) in enumerate(zip(job.varied_starts.make(values), all_settings, strict=True)):
        if isinstance(made, Exception):  # `run` has the message
            continue
        mech, start = made.mech, _Start(i, made)
        text = json.dumps(settings) if settings else ""
        if last != (mech, text):
            key = (text, mech.duration, *made.shared_parts)
            try:
                if key not in found and _needs_python(job, settings, start):
                    break
            except Exception:  # as above
                continue
            last, group = (mech, text), found.setdefault(key, (settings, []))[1]
        group.append(start)
    return list(found.values())


def _needs_python(job: Job, settings: dict[str, Any], start: _Start) -> bool:
    one = _prepared(job, settings, start)
    reason = why_not_in_core(one, job.signals)
    one.release()
    return bool(reason)


def _prepared(job: Job, settings: dict[str, Any], start: _Start) -> RunState:
    """Return a run before its beginning.

    Raises:
        MbdaeError: for invalid settings.
    """
    given = {name: x for name, x in {**job.settings, **settings}.items() if name != "events"}
    mech = start.at.mech
    return prepare_at(mech, RunOptions.from_settings(mech, job.span(mech), given), start.at.point)


def _completed(
    job: Job, settings: dict[str, Any], tasks: Sequence[Task], starts: Sequence[_Start], stop: StopFlag
) -> dict[int, Row]:
    """Return the rows of the tasks that the core completed, by their indices in the batch."""
    one, in_place = _prepared(job, settings, starts[0]), starts[0].at.in_place
    if in_place and not supports_parameters_in_place(one.options):
        return {}
    try:
        points, parameters = np.array([x.at.point for x in starts]), run_parameters([x.at for x in starts])
        runs = solve_in_core(one, points, stop.memory, parameters)
        values = signals_at_end(one, runs, job.signals)
    except MbdaeError:  # `run` has the message
        return {}
    finally:
        one.release()
    done = np.flatnonzero(runs.finished)
    indices = [starts[k].i for k in done.tolist()]
    made = [tasks[i] for i in indices]
    common = {"status": "finished", "message": STATUS["finished"], "t": one.options.t1, "backend": one.stepper.backend}
    columns: dict[str, Iterable[Any]] = {name: repeat(x) for name, x in (dict.fromkeys(job.columns) | common).items()}
    columns |= {"run": [task.run for task in made], "seed": [task.seed for task in made], MORE: repeat({})}
    columns |= {name: [task.values.get(name) for task in made] for name in names(made)}
    columns |= zip(COUNTS, runs.counts[done].T.tolist(), strict=True)
    columns |= zip(map(label, job.outputs), values.T.tolist(), strict=True)
    return {i: dict(zip(columns, row, strict=True)) for i, *row in zip(indices, *columns.values(), strict=False)}
