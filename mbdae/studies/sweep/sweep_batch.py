"""Batches of runs of a sweep: those with outputs at the end alone are completed in the compiled core, if possible."""

import json
from collections import defaultdict
from collections.abc import Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from ...errors import STATUS, MbdaeError
from ...integrate.options.options import RunOptions
from ...integrate.run.run_setup import prepare_at
from ...integrate.run.whole_runs import COUNTS, complete_runs
from ...mechanism import Mechanism
from ...system import Array
from ..final_signals import signals_at_end, why_not_in_core
from ..workers import StopFlag
from .outputs import parse
from .plan import Task
from .sweep_run import Job, maker_of_job, run, split

MAX_BATCH = 32  # runs
FINAL = "final"
Row = dict[str, Any]


class _Start(NamedTuple):
    """Start of a task: its index in the batch, its mechanism and its first point (n,)."""

    i: int
    mech: Mechanism
    y: Array


def takes_batches(job: Job) -> bool:
    """Return whether the core may complete the runs of a sweep: signals at their ends are all that is wanted."""
    final = all(isinstance(x, str) and parse(x).reduction == FINAL for x in job.outputs)
    return final and job.times is None and not job.settings.get("events")


def batches_of(plan: Sequence[Task], pending: int) -> list[Sequence[Task]]:
    """Split the tasks into batches for threads, with so many pending ones."""
    size = max(1, min(MAX_BATCH, len(plan) // (2 * pending)))
    return [plan[i : i + size] for i in range(0, len(plan), size)]


def run_batch(job: Job, batch: Sequence[Task], stop: StopFlag) -> list[Row]:
    """Return the rows of several tasks; those that the core cannot complete are run one by one."""
    rows: dict[int, Row] = {}
    for settings, starts in _groups(job, batch):
        rows |= _completed(job, json.loads(settings), batch, starts, stop)
    return [rows[i] if i in rows else run(job, task, stop) for i, task in enumerate(batch)]


def _groups(job: Job, batch: Sequence[Task]) -> list[tuple[str, list[_Start]]]:
    """Return the starts of tasks whose mechanisms differ in their starts alone, with the same settings."""
    maker, found = maker_of_job(job), defaultdict[tuple, list[_Start]](list)
    for i, task in enumerate(batch):
        values, settings = split(task.values, maker, task.seed)
        try:
            mech = maker.make(values)
            y = mech.point(t=job.span(mech)[0])
        except Exception:  # `run` has the message
            continue
        parts = tuple(map(id, (mech.model, mech.constraints, mech.forces, mech.settings)))
        found[json.dumps(settings), mech.duration, parts].append(_Start(i, mech, y))
    return [(key[0], starts) for key, starts in found.items()]


def _completed(
    job: Job, settings: dict[str, Any], batch: Sequence[Task], starts: Sequence[_Start], stop: StopFlag
) -> dict[int, Row]:
    """Return the rows of the tasks that the core completed, by their indices in the batch."""
    started, mech = perf_counter(), starts[0].mech
    names = [parse(x).signal for x in job.outputs if isinstance(x, str)]
    given = {name: x for name, x in {**job.settings, **settings}.items() if name != "events"}
    y = np.array([start.y for start in starts])
    try:
        options = RunOptions.from_settings(mech, job.span(mech), given)
        one = prepare_at(mech, options, y[0])
        if why_not_in_core(one, names):
            one.release()
            return {}
        runs = complete_runs(one, y, stop.memory)
        values = signals_at_end(one, runs, names)
        one.release()
    except MbdaeError:  # `run` has the message
        return {}
    done = np.flatnonzero(runs.finished).tolist()
    seconds = (perf_counter() - started) / max(1, len(done))
    common = {"status": "finished", "message": STATUS["finished"], "t": options.t1, "backend": one.stepper.backend}
    common |= {"samples": {}, "more": {}, "seconds": seconds}
    return {
        starts[k].i: {
            "run": batch[starts[k].i].run,
            **common,
            **dict(zip(COUNTS, runs.counts[k].tolist(), strict=True)),
            "numbers": dict(zip(job.outputs, x.tolist(), strict=True)),
        }
        for k, x in zip(done, values, strict=True)
    }
