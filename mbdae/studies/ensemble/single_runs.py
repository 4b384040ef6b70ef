"""Runs of an ensemble that need Python, each by `mbdae.solve`."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ...errors import MbdaeError
from ...integrate.run.core_runs import COUNTS
from ...integrate.solve import solve
from ...solution.signals import signals
from ...solution.solution import Solution
from ..workers import StopFlag, pool, stop_check
from .batch import EnsembleJob
from .run_results import UNFINISHED

Progress = Callable[[float, str], None]


def complete_in_python(job: EnsembleJob, workers: int | None, progress: Progress | None = None) -> None:
    """Complete the runs that need Python by `mbdae.solve`, on several threads, until Ctrl-C.

    If runs call functions of Python, which may have internal state, a single thread computes them in turn.
    """
    pending = {i: reason for i, reason in enumerate(job.results.reasons) if reason}
    done = [job.starts.n - len(pending)]

    def report(i: int, _: None) -> None:
        done[0] += 1
        if progress:
            progress(done[0] / job.starts.n, f"{done[0]} of {job.starts.n} runs, {pending[i]} by mbdae.solve")

    count = 1 if job.calls_python else workers
    with suppress(KeyboardInterrupt), pool("threads", count, _complete, job, "") as threads:
        threads.run(pending, report)


def _complete(job: EnsembleJob, i: int, stop: StopFlag) -> None:
    try:
        mech = job.mechanism(i)
        sol = solve(mech, job.t_span, *job.starts.arguments(i), progress=stop_check(stop), **job.settings)
    except MbdaeError as e:
        job.results.fail(np.array([i]), e)
        return
    if sol.status != UNFINISHED:
        _store(job, i, sol)


def _store(job: EnsembleJob, i: int, sol: Solution) -> None:
    found = job.results
    found.t[i], found.y[i] = sol.t[-1], sol.y[-1]
    found.counts[i] = [sol.stats[name] or 0 for name in COUNTS]
    found.drift[i] = sol.stats["drift"]
    found.signals[i] = [x[-1] for x in signals(sol, job.names).values()] if job.names else []
    found.status[i], found.message[i] = sol.status, sol.message
