"""Batches of runs of a sweep, for threads, processes and clusters.

Runs whose outputs are final values are completed in the compiled core, if possible.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain, islice
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from ...errors import STATUS, MbdaeError
from ...integrate.options.options import RunOptions
from ...integrate.run.core_runs import COUNTS, solve_in_core, supports_parameters_in_place
from ...integrate.run.run_setup import prepare_at
from ...integrate.run.run_state import RunState
from ...mechanism import Mechanism
from ..final_signals import reason_not_in_core, signals_at_end
from ..run_columns import equal_rows
from ..varied_starts import RunStarts
from ..workers import StopFlag, batch_size
from .outputs import label, parse
from .plan import Runs
from .results_file import MORE, Results, results_of
from .sweep_run import SOLVE, Job, run, split

MAX_BATCH = 500  # largest number of runs of a batch
BATCH_SECONDS = 0.2  # wall time of a batch of several runs: at least ten times that of its transfer to a cluster
LAST_RUNS = 8  # number of runs whose mean time determines the length of the next batch
FIRST_BATCH, FIRST_PART = 8, 1 / 32  # largest number, and fraction, of runs in a batch before any has finished
FINAL = "final"


class FinishedRuns(NamedTuple):
    """Results of runs that finished together, and the wall time of each in s."""

    results: Results
    seconds: float


def batches_of(plan: Sequence[Runs], pending: int, seconds: dict[int, float]) -> Iterator[Runs]:
    """Yield the runs in batches, see `batch_size`; they are short enough for a stop to lose little.

    Args:
        plan: the runs.
        pending: number of batches that are submitted at a time.
        seconds: wall times of finished runs by run number, in the order in which they finished.
    """
    remaining = sum(map(len, plan))
    first = min(FIRST_BATCH, int(FIRST_PART * remaining / pending))
    for runs in plan:
        i = 0
        while i < len(runs):
            last = list(islice(reversed(seconds.values()), LAST_RUNS))
            mean = sum(last) / len(last) if last else None
            longest = max(1, min(MAX_BATCH, int(BATCH_SECONDS / mean)) if mean else first)
            batch = runs.subset(slice(i, i + min(longest, batch_size(remaining, pending, mean))))
            yield batch
            i, remaining = i + len(batch), remaining - len(batch)


def run_batch(job: Job, batch: Runs, stop: StopFlag | None = None) -> list[FinishedRuns]:
    """Return the results of a batch; runs that the core cannot complete are executed one by one, until a stop."""
    flag = stop or StopFlag()
    found = [*_completed_in_core(job, batch, flag)] if _needs_final_values_only(job) else []
    done = {*chain.from_iterable(x.results["run"] for x in found)}
    for task in batch.without(done).tasks():
        if flag():
            break
        row, seconds = run(job, task, flag)
        if row["status"] != "interrupted":
            found.append(FinishedRuns(results_of([row]), seconds))
    return found


def _needs_final_values_only(job: Job) -> bool:
    """Return whether all outputs are final values of signals, so that the core may complete the runs."""
    return job.times is None and all(isinstance(x, str) and parse(x).reduction == FINAL for x in job.outputs)


def _completed_in_core(job: Job, batch: Runs, stop: StopFlag) -> Iterator[FinishedRuns]:
    """Yield the runs that the core completed, up to the first that needs Python, as later ones probably do, too."""
    for settings, runs in _by_settings(job, batch):
        if settings.get("events"):
            return
        parameters, _ = split(runs.columns, job.factory, runs.seeds)
        for group in job.varied_starts.groups(parameters, len(runs)):
            started = perf_counter()
            with suppress(MbdaeError), _prepare(job, settings, group.mech) as prepared:  # `run` has the message
                if reason_not_in_core(prepared, job.signals):
                    return
                starts = group.begin()
                if starts.parameters.locations and not supports_parameters_in_place(prepared.options):
                    continue
                results = _run_in_core(job, prepared, runs, starts, stop)
                if k := len(results["run"]):
                    yield FinishedRuns(results, (perf_counter() - started) / k)


def _by_settings(job: Job, batch: Runs) -> Iterator[tuple[dict[str, Any], Runs]]:
    """Yield runs of a batch with equal settings of `mbdae.solve`, and these settings with those of the sweep."""
    names = [name for name in batch.columns if name.startswith(SOLVE)]
    for which in equal_rows(batch.columns, names, len(batch)):
        runs = batch if len(which) == len(batch) else batch.subset(which)
        yield job.settings | {name.removeprefix(SOLVE): runs.columns[name][0] for name in names}, runs


@contextmanager
def _prepare(job: Job, settings: dict[str, Any], mech: Mechanism) -> Iterator[RunState]:
    """Yield a prepared run without its initial point.

    Raises:
        MbdaeError: for invalid settings.
    """
    settings = {name: x for name, x in settings.items() if name != "events"}
    no_point = np.full(mech.nq + mech.nv + len(mech.states) + 1, np.nan)
    run = prepare_at(mech, RunOptions.from_settings(mech, job.span(mech), settings), no_point)
    try:
        yield run
    finally:
        run.release()


def _run_in_core(job: Job, prepared: RunState, runs: Runs, starts: RunStarts, stop: StopFlag) -> Results:
    """Return the results of the runs that the core completed."""
    found = solve_in_core(prepared, starts.y, stop.memory, starts.parameters)
    values = signals_at_end(prepared, found, job.signals)
    done = np.flatnonzero(found.finished)
    completed = runs.subset(starts.i[done].tolist())
    common = {"status": "finished", "message": STATUS["finished"], "t": prepared.options.t1}
    common |= {"backend": prepared.stepper.backend}
    k = len(completed)
    columns = {name: [x] * k for name, x in (dict.fromkeys(job.columns) | common).items()} | dict(completed.columns)
    columns |= {"run": completed.run, "seed": completed.seeds, MORE: [{} for _ in range(k)]}
    columns |= zip(COUNTS, found.counts[done].T.tolist(), strict=True)
    return columns | dict(zip(map(label, job.outputs), values.T.tolist(), strict=True))
