"""The runs of a method on a model: errors, work and times from coarse to fine, and the energy over a long time."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from time import thread_time
from typing import Any

from ...data_types import JsonObject
from ...errors import MbdaeError
from ...solution.solution import Solution
from ..comparison.comparison import KNOWN_ERROR_RATIO, QUANTITIES
from ..comparison.reference_motion import ReferenceMotion, Trial
from ..comparison.run_result import RunResult, read_run_result
from ..drift.drift import drift
from ..method_variant import Variant
from ..workers import Stop
from .model_motion import ModelMotion, Settings, common_motion, mechanism

TIMED_RUNS = 3  # number of executions of each run, to measure its CPU time
MAX_REPEATED_TIME = 0.1  # s: longer runs are timed once
MAX_SOLVES = 20_000  # linear solves of a run, above which no finer one follows
LONG_SPAN, LONG_REFINEMENT = 10, 2  # factors of a long run: duration, and refinement of the coarsest steps
SIGMAS = 3  # a trend within this number of standard errors is not significant
RAISED = "error"  # status of a run that raised an error


@dataclass(frozen=True)
class LongRun:
    """The energy of a conservative model over a long time, with fixed steps.

    Attributes:
        step: step size in s.
        t_end: end time in s.
        status: one of `mbdae.errors.STATUS`, or `RAISED`.
        message: why the run did not reach the end, or warnings; "" for none.
        trend: trend of the energy error in J/s.
        trend_error: standard error of the trend in J/s.
        energy: largest energy error, relative to ``scale``.
        scale: reference energy in J.
        g: max |g| over all rows and steps (m, rad).
        Gv: max |G v| over all rows and steps (m/s, rad/s).
        solves: number of linear solves.
    """

    step: float
    t_end: float
    status: str
    message: str = ""
    trend: float | None = None
    trend_error: float | None = None
    energy: float | None = None
    scale: float | None = None
    g: float | None = None
    Gv: float | None = None
    solves: int = 0

    @property
    def largest_rate(self) -> float | None:
        """Upper bound of the relative energy rate in 1/s: |trend| plus three standard errors, over the scale."""
        if self.trend is None or self.trend_error is None or not self.scale:
            return None
        return (abs(self.trend) + SIGMAS * self.trend_error) / self.scale

    @property
    def has_trend(self) -> bool:
        """Whether the trend exceeds three standard errors."""
        return self.trend is not None and self.trend_error is not None and abs(self.trend) > SIGMAS * self.trend_error


@dataclass(frozen=True)
class MethodRuns:
    """The runs of a method on a model.

    Attributes:
        model: name or path.
        method: name of the variant.
        points: runs of the method, from coarse to fine.
        long: the run of a conservative model over a long time.
    """

    model: str
    method: str
    points: tuple[RunResult, ...]
    long: LongRun | None = None

    def to_dict(self) -> JsonObject:
        """Return JSON data, see `read`."""
        rows = [p.row(tuple(QUANTITIES)) for p in self.points]
        long = asdict(self.long) if self.long else None
        return {"model": self.model, "method": self.method, "points": rows, "long": long}

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> "MethodRuns":
        """Return the runs from JSON data."""
        points = tuple(read_run_result(row, tuple(QUANTITIES)) for row in data["points"])
        return cls(data["model"], data["method"], points, LongRun(**data["long"]) if data["long"] else None)


@dataclass(frozen=True)
class MethodTask:
    """The task of a worker to run a method on a model.

    Attributes:
        motion: motion of the model.
        method: name of the variant.
    """

    motion: ModelMotion
    method: str

    def __str__(self) -> str:
        return f"{self.motion.model}, {self.method}"

    def run(self, settings: Settings, stop: Stop | None) -> MethodRuns:
        """Run the method at each setting, then repeat the runs to measure their times.

        Finer runs are omitted after a run with many linear solves, or with an error below five times the uncertainty
        of the reference.
        """
        variant, motion = Variant.parse(self.method), common_motion(mechanism(self.motion.model), settings.backend)
        fixed = [Trial(variant, None, k * self.motion.steps) for k in settings.refinements]
        points: dict[Trial, RunResult] = {}
        for trial in [Trial(variant, r) for r in settings.rtol] if variant.controlled else fixed:
            points[trial] = p = self._measure(motion, trial, stop)
            known = not p.success or p.errors["q"] >= KNOWN_ERROR_RATIO * self.motion.uncertainty["q"]
            if not known or p.solves > MAX_SOLVES:
                break
        for _ in range(TIMED_RUNS - 1):
            for trial, p in points.items():
                if p.success and p.times[0] < MAX_REPEATED_TIME:
                    points[trial] = replace(p, times=(*p.times, _timed(motion, trial, stop)[1]))
        long = self._long(motion, variant, stop) if self.motion.conservative else None
        return MethodRuns(self.motion.model, self.method, tuple(points.values()), long)

    def _measure(self, motion: ReferenceMotion, trial: Trial, stop: Stop | None) -> RunResult:
        try:
            sol, seconds = _timed(motion, trial, stop)
            p = motion.measure(trial, sol, self.motion.reference_samples)
        except MbdaeError as e:
            return RunResult(*trial.label, RAISED, message=str(e))
        return replace(p, times=(seconds,)) if p.success else p

    def _long(self, motion: ReferenceMotion, variant: Variant, stop: Stop | None) -> LongRun:
        n, end = LONG_SPAN * LONG_REFINEMENT * self.motion.steps, LONG_SPAN * self.motion.duration
        step = end / n
        try:
            sol = replace(motion, t_span=(0.0, end)).solve(Trial(variant, None, n), stop)
        except MbdaeError as e:
            return LongRun(step, end, RAISED, str(e))
        if not sol.ended:
            return LongRun(step, end, sol.status, sol.message)
        d = drift(sol)
        message = "" if sol.status == "finished" else sol.message
        energies = (d.energy_trend, d.energy_trend_error, d.energy_relative, d.energy_scale)
        return LongRun(step, end, sol.status, message, *energies, d.g_max, d.Gv_max, sol.stats["solves"])


def _timed(motion: ReferenceMotion, trial: Trial, stop: Stop | None) -> tuple[Solution, float]:
    """Return a run and its CPU time in s, which depends little on other processes."""
    start = thread_time()
    sol = motion.solve(trial, stop)
    return sol, thread_time() - start
