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

LONG_RUN = 2.0  # s, runs above it are timed once
Progress = Callable[[float, str], None]


class TrialConditions(NamedTuple):
    """Data that all runs share: the motion, the reference, and whether the first repetition is timed."""

    motion: ReferenceMotion
    reference: Samples | None = None
    timed: bool = False


def run_and_compare(conditions: TrialConditions, trial: Trial, stop: Stop | None = None) -> RunResult:
    """Run a trial and compare it with the reference."""
    assert conditions.reference is not None
    sol = conditions.motion.solve(trial, stop)
    point = conditions.motion.measure(trial, sol, conditions.reference)
    return replace(point, times=(sol.stats["seconds"],)) if conditions.timed and point.success else point


def time_run(conditions: TrialConditions, trial: Trial, stop: Stop | None = None) -> float:
    """Repeat a run and return its wall time in s."""
    return conditions.motion.solve(trial, stop).stats["seconds"]


class ComparisonRuns:
    """The runs of a comparison, the finished ones, and the file that stores them.

    Args:
        motion: the motion.
        trials: the runs.
        pair: the two methods of the reference.
        rtol: tolerance of the reference.
        path: the file, if any; it is read when it exists, without wall times of another machine.
        progress: see `mbdae.compare`.
        repetitions: number of runs of each trial.
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
        repetitions: int,
        fresh: bool = False,
    ) -> None:
        self.motion, self.trials, self.pair, self.rtol, self.path = motion, trials, pair, rtol, path
        self.report_progress: Progress = progress or (lambda done, name: None)
        self.repetitions, self.completed = repetitions, 0
        self.points: dict[tuple, RunResult] = {}
        self.reference, self.cross_check = "", ""
        self.uncertainty: dict[str, float] = {}
        self.samples: Samples | None = None
        about = {"versions": versions(), "command": sys.argv, "machine": machine_description(), "runs": len(trials)}
        self.meta = {"key": self.key(), **about, "backend": motion.backend, "because": motion.python_reason}
        if isinstance(motion.problem, Mechanism):
            self.meta["units"] = quantity_units(motion.problem)
        if path and path.exists() and not fresh:
            self._read(path)

    def key(self) -> str:
        """Return the key of comparisons that can reuse each other's runs: problem, start, times, reference, version.

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
        identity = (
            *custom, problem, *(x.tolist() for x in c.start), c.t_span, c.times.tolist(),
            [str(v) for v in self.pair], self.rtol, c.max_steps, c.backend, versions()["mbdae"],
        )  # fmt: skip
        return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()

    def _read(self, path: Path) -> None:
        stored = Comparison.load(path)
        if stored.meta.get("key") != self.key():
            difference = "another mechanism, span, reference or version of mbdae"
            raise InputError(f"{path} has a comparison of {difference}: give another file, or remove this one")
        same_machine = stored.meta.get("machine") == self.meta["machine"]  # times of two machines are not comparable
        self.points = {p.label: p if same_machine else replace(p, times=()) for p in stored.points}
        self.reference, self.cross_check, self.uncertainty = stored.reference, stored.cross_check, stored.uncertainty

    def pending(self) -> list[Trial]:
        """Return the runs that are not finished."""
        return [t for t in self.trials if t.label not in self.points]

    def compute_reference(self) -> None:
        """Compute the reference, if any run is pending."""
        if self.pending():
            self.report_progress(0.0, "reference")
            names, self.samples, self.uncertainty = self.motion.reference(self.pair, self.rtol)
            self.reference, self.cross_check = names

    def measure_errors(self, workers: int, *, timed: bool) -> None:
        """Run the pending trials, in this process or in others."""
        pending = self.pending()
        if self.samples is not None and pending:
            conditions = TrialConditions(self.motion, self.samples, timed)
            self._run_all(run_and_compare, conditions, pending, workers, lambda trial, point: self._store(point))

    def measure_times(self, repeats: int, workers: int) -> None:
        """Repeat the runs in turn to measure wall times; long runs are timed once."""

        def record_time(trial: Trial, seconds: float) -> None:
            point = self.points[trial.label]
            self._store(replace(point, times=(*point.times, seconds)))

        labels = {t.label: t for t in self.trials}
        for r in range(repeats):
            short = [
                labels[k] for k, p in self.points.items() if k in labels and len(p.times) <= r and _is_repeatable(p)
            ]
            if short:
                label = f"time {r + 1} of {repeats}: "
                self._run_all(time_run, TrialConditions(self.motion), short, workers, record_time, label)

    def _run_all(
        self,
        function: Callable[..., Any],
        conditions: TrialConditions,
        trials: Sequence[Trial],
        workers: int,
        store: Callable[[Trial, Any], None],
        label: str = "",
    ) -> None:
        """Call a function for each of the runs, in this process or in others, and store the results."""
        if workers == 1:
            for i, trial in enumerate(trials):
                self._report(i / len(trials), f"{label}{trial}")
                store(trial, function(conditions, trial))
        else:
            finished = []

            def record_run(trial: Trial, result: object) -> None:
                finished.append(trial)
                self._report(len(finished) / len(trials), f"{label}{trial} done")
                store(trial, result)

            motion = replace(conditions.motion, problem=without_geometry(conditions.motion.problem))
            with pool("processes", workers, function, conditions._replace(motion=motion), "workers=1") as workers_pool:
                workers_pool.run(trials, record_run)
        self.completed += 1

    def _report(self, fraction: float, name: str) -> None:
        """Report the progress: completed repetitions plus the fraction of the current repetition."""
        self.report_progress(min(1.0, (self.completed + fraction) / self.repetitions), name)

    def _store(self, point: RunResult) -> None:
        self.points[point.label] = point
        if self.path:
            self._comparison(list(self.points), complete=False).save(self.path)

    def result(self, complete: bool) -> Comparison:
        """Return the finished runs among the requested ones; the file also keeps runs of earlier calls."""
        if complete and self.path:
            self._comparison(list(self.points), complete=True).save(self.path)
        return self._comparison([], complete)

    def _comparison(self, extra_labels: list[tuple], complete: bool) -> Comparison:
        c, labels = self.motion, [t.label for t in self.trials]
        points = ordered(self.points.values(), list(dict.fromkeys([*labels, *extra_labels])))
        about = (self.reference, self.cross_check, self.uncertainty)
        return Comparison(c.problem.title, c.t_span, points, *about, complete, self.meta)


def _is_repeatable(point: RunResult) -> bool:
    return point.success and not (point.times and point.times[0] > LONG_RUN)


def without_geometry(problem: Problem) -> Problem:
    """Return the problem without geometry, which may take hundreds of megabytes, and without its source files."""
    if not isinstance(problem, Mechanism):
        return problem
    out = copy(problem)
    out.visuals = out.source = None
    out.__dict__.pop("scene", None)
    return out
