"""Times at which a problem may jump: steps end there, and the next one starts after the jump.

The right-hand side may be evaluated at both ends of a step, and takes the value after a jump at exactly its time. So a
step towards a jump ends a few roundings before it, where all values are those before; the next one starts at the jump.
A solution has both points.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError, StepError
from ...mechanism import Mechanism
from ...mechanism.formulations.index2 import Index2System
from ...system import Array, System
from .source import EventSource, Occurrence

if TYPE_CHECKING:
    from ..run_state import RunState
    from ..step_map import StepMap

MAX_CLUSTER = 100  # jumps within rounding of one another that count as one
MARGIN = 8  # roundings of t by which a step stays before a jump: more than the error of its stage times


class SmoothInterval(NamedTuple):
    """The interval up to the next jump or the end of the span.

    Attributes:
        stop: end of the last step.
        end: time that is recorded for it: the end of the span, if it coincides with a jump.
        restart: start of the next interval; None after the end.
    """

    stop: float
    end: float
    restart: float | None


class Jumps(EventSource):
    """Upcoming jumps of a run: of the system, and times given by the user.

    Args:
        system: provides its breakpoints.
        times: given by the user.
        t1: end of the span.
        sign: direction of time.
        knots: further times where steps end.

    Raises:
        InputError: for times that are not numbers.
    """

    def __init__(
        self, system: System, times: Sequence[float], t1: float, sign: float, knots: Sequence[float] = ()
    ) -> None:
        self.system, self.times, self.t1, self.sign = system, sorted({*_checked(times), *knots}), t1, sign

    @classmethod
    def of(cls, run: "RunState") -> "Jumps":
        o = run.options
        return cls(run.system, o.jumps, o.end, o.sign, _knots(run))

    def start(self, run: "RunState", y: Array) -> Array:
        """Return y just after a time where states of sampled controllers may jump."""
        return self.system.jump(run.t, y)

    def leg(self, t: float) -> SmoothInterval:
        """Return the smooth interval from t on. Jumps that differ only by rounding count as one.

        Raises:
            StepError: if an unlimited number of jumps follow one another that closely.
        """
        s, margin = self.sign, MARGIN * float(np.spacing(max(abs(t), abs(self.t1))))
        first = self._next(self._last(t, 4 * margin))
        if s * (first - self.t1) > 4 * margin:
            return SmoothInterval(self.t1, self.t1, None)
        stop = first - s * margin
        if s * (self.t1 - first) <= 4 * margin:
            return SmoothInterval(stop, self.t1, None)
        last = self._last(first, 4 * margin)
        return SmoothInterval(stop, stop, last if s > 0 else last - margin)

    def first(self, step: "StepMap") -> Occurrence | None:
        """Return the end of a step that ends a smooth interval, unless the span ends there."""
        run = step.run
        return Occurrence(run.t) if run.t == run.leg.end and run.leg.restart is not None else None

    def act(self, run: "RunState") -> bool:
        """Restart after the jump."""
        assert run.leg.restart is not None
        run.restart_after_jump(run.leg.restart)
        return False

    def _next(self, t: float) -> float:
        s = self.sign
        i = bisect_right(self.times, t) if s > 0 else bisect_left(self.times, t) - 1
        own = self.times[i] if 0 <= i < len(self.times) else s * np.inf
        return s * min(s * self.system.breakpoint(t, s), s * own)

    def _last(self, t: float, near: float) -> float:
        """Return the last of the jumps that follow t, and one another, within ``near``; t if there is none."""
        for _ in range(MAX_CLUSTER):
            later = self._next(t)
            if self.sign * (later - t) > near:
                return t
            t = later
        raise StepError("step_size", f"jumps follow one another too closely at t = {t:.17g}: a sampling rate too high?")


def _knots(run: "RunState") -> Sequence[float]:
    """Return the knots of loads and motions if the run has modes: loads may have extrema between two of them."""
    problem, system = run.problem, run.system
    if not isinstance(problem, Mechanism) or not isinstance(system, Index2System) or not problem.switches:
        return ()
    laws = (signal for law, _ in system.laws.bound for signal in law.signals)
    drives = (d.path for d in problem.drivers)
    commands = (clutch.engaged for clutch in problem.clutches if clutch.engaged)
    return [t for signal in (*laws, *drives, *commands) for t in signal.meets(run.options.t0, run.options.end)]


def _checked(times: Sequence[float]) -> list[float]:
    try:
        out = np.asarray(times, float)
    except (TypeError, ValueError):
        out = np.full(1, np.nan)
    if out.ndim != 1 or not np.isfinite(out).all():
        raise InputError(f"jumps is a list of times, got {times!r:.80}")
    return [float(x) for x in out]
