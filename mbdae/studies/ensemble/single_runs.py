"""Runs of an ensemble that need Python, one after another by `mbdae.solve`."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ...errors import MbdaeError
from ...integrate.solve import solve
from ...solution.columns import residuals
from ...solution.signals import signals
from ...solution.solution import Solution
from .batch import COUNTS, UNFINISHED, EnsembleJob

Progress = Callable[[float, str], None]


def complete_singly(job: EnsembleJob, progress: Progress | None = None) -> None:
    """Make all runs that are left by `mbdae.solve`, until Ctrl-C."""
    left = [i for i, reason in enumerate(job.results.reasons) if reason]
    with suppress(KeyboardInterrupt):
        for k, i in enumerate(left):
            try:
                mech = job.mechanism(i)
                sol = solve(mech, job.t_span, *job.starts.arguments(i), **job.settings)
            except MbdaeError as e:
                job.results.fail(np.array([i]), e)
                continue
            if sol.status == UNFINISHED:
                return
            _store(job, i, sol)
            if progress:
                progress(1 - (len(left) - k - 1) / job.starts.n, f"{k + 1} of {len(left)} runs by mbdae.solve")


def _store(job: EnsembleJob, i: int, sol: Solution) -> None:
    found, mech = job.results, sol.mechanism
    found.t[i], found.y[i] = sol.t[-1], sol.y[-1]
    found.counts[i] = [sol.stats[name] or 0 for name in COUNTS]
    found.drift[i] = np.abs(residuals(sol).g / mech.row_scales).max(initial=0.0)
    found.signals[i] = [x[-1] for x in signals(sol, job.names).values()] if job.names else []
    found.status[i], found.message[i] = sol.status, sol.message
