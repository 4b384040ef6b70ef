"""Times at which a problem may jump: steps end there, and the next step starts after the jump.

The right-hand side may be evaluated at both ends of a step. At exactly the time of a jump it has its value after the
jump, so a step towards a jump ends a few ulps of t earlier, and the next step starts at the jump. A solution has a node
at both times.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from math import inf, isfinite, nextafter, ulp
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...arguments import as_numbers
from ...errors import InputError, StepError
from ...system import Array, System
from ...tolerances import JUMP_MARGIN
from .source import EventSource, Occurrence

if TYPE_CHECKING:
    from ..run.run_state import RunState
    from ..run.step_map import StepMap

MAX_CLUSTER = 100  # jumps that differ only by rounding and count as one
LATE = 4 * JUMP_MARGIN  # ulps of t: jumps this close count as one, and as the start of a run


class SmoothInterval(NamedTuple):
    """The interval up to the next jump or the end of the span.

    Attributes:
        stop: end of the last step.
        end: recorded end time of the last step; it differs from stop only if the end of the span coincides with a jump.
        restart: start of the next interval; None at the end of the span.
    """

    stop: float
    end: float
    restart: float | None

    def leaves_jump(self, t: float) -> bool:
        """Return whether this interval ends the span at t, at a jump, so that a continued run begins with the jump."""
        return t == self.end != self.stop


class Jumps(EventSource):
    """Upcoming jumps of a run: breakpoints of the system, and times given by the user.

    Args:
        system: the system, which provides breakpoints.
        times: times given by the user.
        t1: end of the span.
        sign: direction of time.
        knots: further times where steps end.

    Raises:
        InputError: for invalid times.
    """

    def __init__(
        self, system: System, times: Sequence[float], t1: float, sign: float, knots: Sequence[float] = ()
    ) -> None:
        self.system, self.user_times, self.t1, self.sign = system, _checked(times), t1, sign
        self.times = sorted({*self.user_times, *knots})
        self._following = inf, -inf  # sign * t, twice: a time, and the next jump after it

    @classmethod
    def from_run(cls, run: "RunState") -> "Jumps":
        o = run.options
        return cls(run.system, o.jumps, o.end, o.sign, _knots(run, o.t0, o.end))

    def extend(self, run: "RunState", t1: float) -> None:
        """Move the end of the span."""
        self.t1 = t1
        if run.mode_changes:
            self._following = inf, -inf
            self.times = sorted({*self.user_times, *_knots(run, run.t, t1)})

    def is_idle(self, run: "RunState", t1: float) -> bool:
        """Return whether no jump lies before t1, or within rounding after it."""
        first, last = self._following
        is_current = first <= self.sign * run.t and run.interval.stop == run.interval.end
        return is_current and self.sign * t1 + _width(run.t, t1) < last and not self._coincide(t1, self.sign * last)

    def adjust_point(self, run: "RunState", y: Array) -> Array:
        """Return y after jumps of the states of sampled controllers.

        A continued run does not sample again if its previous span ended after the sampling instant.
        """
        self._following = inf, -inf  # a sampling instant that the system treats as this time may be later by rounding
        return self.system.jump(run.t, y, LATE if run.t == run.options.t0 else inf)

    def interval(self, t: float) -> SmoothInterval:
        """Return the smooth interval that starts at t. Jumps that differ only by rounding count as one.

        Raises:
            StepError: if more than `MAX_CLUSTER` jumps differ only by rounding.
        """
        s, rounding = self.sign, ulp(max(abs(t), abs(self.t1)))
        margin, late = JUMP_MARGIN * rounding, LATE * rounding
        _, first = self._cluster(t, late)
        distance = s * (first - self.t1)
        if distance > late and not self._coincide(self.t1, first):
            return SmoothInterval(self.t1, self.t1, None)
        stop = first - s * margin
        if distance >= -late:
            return SmoothInterval(s * min(s * stop, s * nextafter(self.t1, -s * inf)), self.t1, None)
        last, _ = self._cluster(first, late)
        return SmoothInterval(stop, stop, last if s > 0 else last - margin)

    def first_event(self, step: "StepMap") -> Occurrence | None:
        """Return the end of a step at which a smooth interval ends, unless it is the end of the span."""
        t, current = step.run.t, step.run.interval
        return Occurrence(t) if t == current.end and current.restart is not None else None

    def handle_event(self, run: "RunState", ended: bool) -> bool:
        """Restart after the jump, unless the run has ended before it."""
        if not ended:
            assert run.interval.restart is not None
            run.restart_after_jump(run.interval.restart)
        return False

    def drop_sampling(self, run: "RunState") -> None:
        """Remove the last node if controllers were sampled just before it: a continued run samples them itself."""
        if len(run.ts) < 2 or not run.mechanism_system:
            return
        t, gap = run.t, abs(run.t - run.ts[-2])  # 0 at a reset
        changed, states = run.ys[-1] != run.ys[-2], slice(-1 - run.mechanism_system.ns, -1)
        at_jump = 0 < gap <= _width(t, self.t1)
        if at_jump and changed.sum() == changed[states].sum() > 0:
            run.drop_nodes_after(len(run.ts) - 2)
            run.t = run.ts[-1] = t  # as at the end of a span
            run.discontinuities -= 1

    def _next(self, t: float) -> float:
        s, (first, last) = self.sign, self._following
        if first <= s * t < last:
            return s * last
        next_jump = self._after(t)
        self._following = s * t, s * next_jump
        return next_jump

    def _after(self, t: float) -> float:
        s = self.sign
        i = bisect_right(self.times, t) if s > 0 else bisect_left(self.times, t) - 1
        user_time = self.times[i] if 0 <= i < len(self.times) else s * inf
        return s * min(s * self.system.breakpoint(t, s), s * user_time)

    def _coincide(self, t: float, jump: float) -> bool:
        """Return whether a run that starts at t, just before a jump, begins with the jump."""
        return isfinite(jump) and self._after(t) != jump

    def _cluster(self, t: float, tolerance: float) -> tuple[float, float]:
        """Return the last jump of the cluster that starts at t, t if there is none, and the jump after it."""
        for _ in range(MAX_CLUSTER):
            next_jump = self._next(t)
            if self.sign * (next_jump - t) > tolerance:
                return t, next_jump
            t = next_jump
        raise StepError("step_size", f"jumps follow one another too closely at t = {t:.17g}: a sampling rate too high?")


def _width(t: float, t1: float) -> float:
    """Return the largest distance in s of the nodes on both sides of a jump at t, in a span that ends at t1."""
    return 2 * LATE * max(ulp(t), ulp(t1))


def _knots(run: "RunState", t0: float, t1: float) -> Sequence[float]:
    """Return the knots of forces and motions between two times if the run has modes: multipliers have extrema there."""
    if not (system := run.mechanism_system) or not system.mechanism.switches:
        return ()
    laws = (u for law, _ in system.laws.bound for u in law.time_functions)
    motions = (d.path for d in run.problem.drivers)
    commands = (clutch.engaged for clutch in system.mechanism.clutches if clutch.engaged)
    return [t for signal in (*laws, *motions, *commands) for t in signal.knots_between(t0, t1)]


def _checked(times: Sequence[float]) -> list[float]:
    if isinstance(times, tuple) and not times:
        return []
    out = as_numbers(times)
    if out.ndim != 1 or not np.isfinite(out).all():
        raise InputError(f"jumps is a list of times, got {times!r:.80}")
    return [float(x) for x in out]
