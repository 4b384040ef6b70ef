"""The runs of a comparison: finished runs, their file, and the order of the remaining runs."""

import hashlib
import json
import sys
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ...backend import machine_description
from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.tree.coordinate_units import quantity_units
from ...methods import Tableau
from ...solution.archive import problem_data
from ...solution.provenance import versions
from ...solution.solution import Problem
from ..method_variant import Variant
from ..workers import Stop, pool
from .comparison import Comparison
from .reference_motion import ReferenceMotion, Samples, Trial
from .run_result import RunResult, ordered

LONG = 2.0  # s: longer runs are timed once
Progress = Callable[[float, str], None]


class TrialConditions(NamedTuple):
    """Data shared by the runs: the motion, the reference, and whether first runs are timed."""

    motion: ReferenceMotion
    reference: Samples | None = None
    clock: bool = False


def measured(job: TrialConditions, trial: Trial, stop: Stop | None = None) -> RunResult:
    """Run a trial and compare it with the reference."""
    assert job.reference is not None
    sol = job.motion.solve(trial, stop)
    point = job.motion.measure(trial, sol, job.reference)
    return replace(point, times=(sol.stats["seconds"],)) if job.clock and point.success else point


def timed(job: TrialConditions, trial: Trial, stop: Stop | None = None) -> float:
    """Repeat a run and return its wall time in s."""
    return job.motion.solve(trial, stop).stats["seconds"]


class RunQueue:
    """The runs of a comparison, the finished ones, and the file that stores them.

    Args:
        motion: the motion.
        trials: the runs.
        pair: methods of the reference.
        rtol: their tolerance.
        path: the file, if any; it is read when it exists, without wall times of another machine.
        progress: see `mbdae.compare`.
        passes: number of repetitions of each run.
        fresh: do not read the file.

    Raises:
        InputError: for a file with another comparison, or of a problem without a name.
    """

    def __init__(
        self,
        motion: ReferenceMotion,
        trials: list[Trial],
        pair: list[Variant],
        rtol: float,
        path: Path | None,
        progress: Progress | None,
        passes: int,
        fresh: bool = False,
    ) -> None:
        self.motion, self.trials, self.pair, self.rtol, self.path = motion, trials, pair, rtol, path
        self.report_progress: Progress = progress or (lambda done, name: None)
        self.passes, self.passed = passes, 0
        self.points: dict[tuple, RunResult] = {}
        self.reference, self.witness = "", ""
        self.uncertainty: dict[str, float] = {}
        self.samples: Samples | None = None
        about = {"versions": versions(), "command": sys.argv, "machine": machine_description(), "runs": len(trials)}
        self.meta = {"key": self.key(), **about, "backend": motion.backend, "because": motion.because}
        if isinstance(motion.problem, Mechanism):
            self.meta["units"] = quantity_units(motion.problem)
        if path and path.exists() and not fresh:
            self._read(path)

    def key(self) -> str:
        """Return a key that comparisons which may share runs have in common: problem, start, times, reference, version.

        Empty for a custom textbook problem: its functions cannot be identified.

        Raises:
            InputError: for such a problem, if there is a file.
        """
        c = self.motion
        custom = [t.variant.method.to_dict() for t in self.trials if isinstance(t.variant.method, Tableau)]
        try:
            problem = problem_data(c.problem)
        except InputError:
            if self.path:
                raise
            return ""
        what = (
            *custom, problem, *(x.tolist() for x in c.start), c.t_span, c.times.tolist(),
            [str(v) for v in self.pair], self.rtol, c.max_steps, c.backend, versions()["mbdae"],
        )  # fmt: skip
        return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()

    def _read(self, path: Path) -> None:
        old = Comparison.load(path)
        if old.meta.get("key") != self.key():
            what = "another mechanism, span, reference or version of mbdae"
            raise InputError(f"{path} has a comparison of {what}: give another file, or remove this one")
        here = old.meta.get("machine") == self.meta["machine"]  # wall times of machines are not compared
        self.points = {p.label: p if here else replace(p, times=()) for p in old.points}
        self.reference, self.witness, self.uncertainty = old.reference, old.witness, old.uncertainty

    def pending(self) -> list[Trial]:
        """Return the runs that are not finished."""
        return [t for t in self.trials if t.label not in self.points]

    def compute_reference(self) -> None:
        """Compute the reference, if any run is pending."""
        if self.pending():
            self.report_progress(0.0, "reference")
            (self.reference, self.witness), self.samples, self.uncertainty = self.motion.reference(self.pair, self.rtol)

    def measure_errors(self, workers: int, *, clock: bool) -> None:
        """Run the pending trials, in this process or in others."""
        todo = self.pending()
        if self.samples is not None and todo:
            job = TrialConditions(self.motion, self.samples, clock)
            self._pass(measured, job, todo, workers, lambda trial, point: self._store(point))

    def measure_times(self, repeats: int, workers: int) -> None:
        """Repeat runs for their wall times, in alternation; those above two seconds once."""

        def record_time(trial: Trial, seconds: float) -> None:
            point = self.points[trial.label]
            self._store(replace(point, times=(*point.times, seconds)))

        labels = {t.label: t for t in self.trials}
        for r in range(repeats):
            short = [
                labels[k] for k, p in self.points.items() if k in labels and len(p.times) <= r and _is_repeatable(p)
            ]
            if short:
                what = f"time {r + 1} of {repeats}: "
                self._pass(timed, TrialConditions(self.motion), short, workers, record_time, what)

    def _pass(
        self,
        function: Callable[..., Any],
        job: TrialConditions,
        trials: Sequence[Trial],
        workers: int,
        store: Callable[[Trial, Any], None],
        what: str = "",
    ) -> None:
        """Call a function for each of the runs, in this process or in others, and store the results."""
        if workers == 1:
            for i, trial in enumerate(trials):
                self._report(i / len(trials), f"{what}{trial}")
                store(trial, function(job, trial))
        else:
            finished = []

            def record_run(trial: Trial, found: object) -> None:
                finished.append(trial)
                self._report(len(finished) / len(trials), f"{what}{trial} done")
                store(trial, found)

            sent = job._replace(motion=replace(job.motion, problem=without_geometry(job.motion.problem)))
            with pool("processes", workers, function, sent, "workers=1") as workers_pool:
                workers_pool.run(trials, record_run)
        self.passed += 1

    def _report(self, fraction: float, name: str) -> None:
        """Report the progress: the number of passes over the runs, and the fraction of the current one."""
        self.report_progress(min(1.0, (self.passed + fraction) / self.passes), name)

    def _store(self, point: RunResult) -> None:
        self.points[point.label] = point
        if self.path:
            self._comparison(list(self.points), complete=False).save(self.path)

    def result(self, complete: bool) -> Comparison:
        """Return the finished runs among the requested ones; the file also keeps runs of earlier calls."""
        if complete and self.path:
            self._comparison(list(self.points), complete=True).save(self.path)
        return self._comparison([], complete)

    def _comparison(self, more: list[tuple], complete: bool) -> Comparison:
        c, labels = self.motion, [t.label for t in self.trials]
        points = ordered(self.points.values(), list(dict.fromkeys([*labels, *more])))
        about = (self.reference, self.witness, self.uncertainty)
        return Comparison(c.problem.title, c.t_span, points, *about, complete, self.meta)


def _is_repeatable(point: RunResult) -> bool:
    return point.success and not (point.times and point.times[0] > LONG)


def without_geometry(problem: Problem) -> Problem:
    """Return the problem without geometry, which may take hundreds of megabytes, and without its source files."""
    if not isinstance(problem, Mechanism):
        return problem
    out = copy(problem)
    out.visuals = out.source = None
    out.__dict__.pop("scene", None)
    return out
