"""Level crossings of signals: bracketed by ends of steps and extrema between them, located on steps of the method.

A step of size theta h from the same start ends at a point of the full order of the method, so the event time has this
order too. The dense output is not used: its order is lower by one.
"""

import re
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...discovery import lazy_import
from ...errors import InputError, StepError
from ...mechanism import Mechanism
from ...mechanism.formulations.index2 import Index2System
from ...solution.columns import TWO_PI
from ...solution.signal_value import SignalValue, find_point_signal, value
from ...system import Array
from ...tolerances import EPS, SOLUTION_ROUNDING

if TYPE_CHECKING:
    from ..run.step_map import StepMap

brentq = lazy_import("scipy.optimize", "brentq")
# A signal neither begins like a number nor ends with another sign: not "0.1 < q.slider < 0.3", not "q.slider >= 0.3".
COMPARISON = re.compile(r"(?P<signal>(?![-+.\d]).*?[^=<>!\s])\s*(?P<sign>[=<>])\s*(?P<level>[^=<>]*)")
DIRECTIONS = {"=": 0, ">": 1, "<": -1}
TIME_SPACINGS = 2  # units in the last place of t: tolerance of the time of an event
RELATIVE_TOLERANCE = 4 * EPS  # tolerance of theta, the time of an event in a step
SIGNED_ZERO = float(np.sqrt(np.finfo(float).tiny))  # for a zero approached from one side; its square is normal
DEPARTURE_WIDTH = 1e-3  # fraction of a step: sample that shows to which side a signal leaves its level
MAX_ITERATIONS = 100  # iterations of Brent's method, which bisects in the worst case
EventRoot = tuple[float, Array]


class LevelCrossing(NamedTuple):
    """The content of an event text: signal, level, and direction (1 rising, -1 falling, 0 both)."""

    signal: str
    level: float
    direction: int


def parse_level_crossing(text: str) -> LevelCrossing:
    """Read ``"signal"``, for its zeros, ``"signal = level"``, ``"signal > level"`` or ``"signal < level"``.

    Raises:
        InputError: for any other text.
    """
    match = COMPARISON.fullmatch(text.strip())
    if not match and not any(sign in text for sign in DIRECTIONS):
        return LevelCrossing(text.strip(), 0.0, 0)
    try:
        level = float(match["level"]) if match else np.nan
    except ValueError:
        level = np.nan
    if not match or not np.isfinite(level):
        raise InputError(f"an event is a signal, or a signal, one of = > <, and a number, got {text!r:.80}")
    return LevelCrossing(match["signal"], level, DIRECTIONS[match["sign"]])


def crossing_at_jump(
    before: float, after: float, direction: int, tangency: float, side: float = 0.0
) -> tuple[bool, float]:
    """Return whether a value crosses or touches zero at a jump, and the value after the jump, without rounding.

    A value that is zero to rounding, was approached from one side, and has not crossed, is returned with the sign of
    this side: it crosses after the jump if it leaves to the other side.

    Args:
        before: the value before the jump.
        after: the value after the jump.
        direction: 1 for rising crossings, -1 for falling crossings, 0 for both.
        tangency: values on both sides of a jump with magnitudes up to this are a tangency.
        side: sign of the value in the last step; 0 if irrelevant.
    """
    if max(abs(before), abs(after)) <= tangency:
        if not direction:
            return before != 0, 0.0
        crossed = side * direction < 0 <= before * direction  # at the end of the last step
        return False, SIGNED_ZERO * (direction if crossed else side)
    return before != 0 and before * after <= 0 and direction * (after - before) >= 0, after


def departure_samples(f0: float) -> list[float]:
    """Return theta of an additional sample if a step starts at zero: it shows to which side the value departs."""
    return [DEPARTURE_WIDTH] if abs(f0) <= SIGNED_ZERO else []


class SignalEvent:
    """A signal minus its level, tracked from step to step.

    Args:
        system: a separate workspace.
        signal: the signal.
        level: the level.
        direction: 1 for rising crossings, -1 for falling crossings, 0 for both.

    Attributes:
        unchanged_within: a velocity this close to the level at both ends of a step counts as constant: sticking joints.
    """

    def __init__(self, system: Index2System, signal: SignalValue, level: float, direction: int) -> None:
        self.system, self.signal, self.level, self.direction = system, signal, level, direction
        self.unchanged_within, i = 0.0, signal.i - system.nq
        if signal.kind == "y" and 0 <= i < system.nv:
            speed = system.mechanism.coordinate_scales[i] * system.mechanism.characteristic_rate
            self.unchanged_within = SOLUTION_ROUNDING * (abs(level) + speed)
        self.node = (np.nan, np.nan, 0.0)  # the last node: time, value, rate of an angle
        self.side = 0.0  # side of the level in the last step; 0 if irrelevant

    @classmethod
    def from_text(cls, system: Index2System, mechanism: Mechanism, text: str, direction: int) -> "SignalEvent":
        """Bind a text to a mechanism.

        Raises:
            InputError: for an invalid text, or a contradictory direction.
            UnknownNameError: for an unknown signal, with the valid ones.
        """
        crossing = parse_level_crossing(text)
        if direction * crossing.direction < 0:
            raise InputError(f"event {text!r} has another direction than direction = {direction}")
        signal = find_point_signal(mechanism, crossing.signal)
        return cls(system, signal, crossing.level, direction or crossing.direction)

    def start_at(self, t: float, y: Array) -> None:
        """Start tracking at a point; an angle starts between -pi and pi."""
        self.advance(t, y, value(self.system, self.signal, t, y) - self.level)

    def advance(self, t: float, y: Array, f: float) -> None:
        """Continue tracking from a point, given the value there."""
        self.node = (t, f, self._speed(y))

    def continue_after_crossing(self, t: float, y: Array) -> None:
        """Continue tracking from an event: the signal has crossed its level."""
        self.side = float(self.direction)
        self.advance(t, y, 0.0)

    def continue_after_other_event(self, t: float, y: Array) -> None:
        """Continue tracking from an event of another signal: if this signal is at its level, it has not crossed it."""
        f = self.value(t, y)
        self.advance(t, y, f if abs(f) > self._rounding else SIGNED_ZERO * self.side)

    @property
    def _rounding(self) -> float:
        return SOLUTION_ROUNDING * (1 + abs(self.level))

    def _speed(self, y: Array) -> float:
        return float(y[self.system.nq + self.signal.rate]) if self.signal.kind == "angle" else 0.0

    def value(self, t: float, y: Array) -> float:
        """Return the signal minus its level; an angle is unwrapped with the velocities."""
        f = value(self.system, self.signal, t, y) - self.level
        if self.signal.kind != "angle":
            return f
        t0, f0, w0 = self.node
        return f + TWO_PI * float(np.round((f0 + (t - t0) * (w0 + self._speed(y)) / 2 - f) / TWO_PI))

    def zeros(self, step: "StepMap", tangency: float | None) -> list[EventRoot]:
        """Return theta and the point of each level crossing in a step; advance to its end.

        Args:
            step: the step.
            tangency: see `crossing_at_jump`; None if there is no jump between the last step and this one.
        """
        hits: list[EventRoot] = []
        if tangency is not None:
            tangency *= 1 + abs(self.level)
            f = self.value(step.t, step.y)
            crosses, f = crossing_at_jump(self.node[1], f, self.direction, tangency, self.side)
            hits += [(0.0, step.y)] if crosses else []
            self.advance(step.t, step.y, f)
        f0, f1 = self.node[1], self.value(step.t1, step.y1)
        if max(abs(f0), abs(f1)) <= self.unchanged_within:
            self.advance(step.t1, step.y1, 0.0)
            return hits
        if abs(f0) > self._rounding:
            self.side = np.sign(f0)
        samples = [(0.0, step.y, f0)]
        for theta in [*departure_samples(f0), *self._interior_extrema(step, f0, f1)]:
            y = step.point(theta)
            samples.append((theta, y, self.value(step.t + theta * step.h, y)))
        samples.append((1.0, step.y1, f1))
        for a, b in pairwise(samples):
            self._append_crossing(hits, a, b, step)
        self.advance(step.t1, step.y1, f1)
        return hits

    def reaches(self, step: "StepMap") -> bool:
        """Return whether the signal reached its level, to rounding, at the end of the last step, in its direction."""
        rise = -self.value(step.t, step.y)
        return abs(self.node[1]) <= self._rounding < abs(rise) and rise * self.direction >= 0

    def _append_crossing(
        self, hits: list[EventRoot], a: tuple[float, Array, float], b: tuple[float, Array, float], step: "StepMap"
    ) -> None:
        """Append the level crossing between two points of a step, given the values there, if there is one."""
        (theta0, y0, f0), (theta1, y1, f1) = a, b
        if self.direction * np.sign(f1 if f0 == 0 else f1 - f0) < 0:
            return
        if f0 == 0 and f1 != 0 and theta0 == 0 and step.first:
            hits.append((0.0, y0))
        elif f0 * f1 < 0:
            hits.append(self._locate(a, b, step))
        elif f1 == 0 and f0 != 0:
            hits.append((theta1, y1))

    def _locate(self, a: tuple[float, Array, float], b: tuple[float, Array, float], step: "StepMap") -> EventRoot:
        """Locate a zero between two points of a step by Brent's method; each evaluation is one step of the method."""
        cache = {a[0]: (a[2], a[1]), b[0]: (b[2], b[1])}

        def at(theta: float) -> tuple[float, Array]:
            if theta not in cache:
                y = step.point(theta)
                cache[theta] = self.value(step.t + theta * step.h, y), y
            return cache[theta]

        tolerance = TIME_SPACINGS * float(np.spacing(max(abs(step.t), abs(step.t1)))) / abs(step.h)
        theta = float(
            brentq(lambda x: at(x)[0], a[0], b[0], xtol=tolerance, rtol=RELATIVE_TOLERANCE, maxiter=MAX_ITERATIONS)
        )
        return theta, at(theta)[1]

    def _interior_extrema(self, step: "StepMap", f0: float, f1: float) -> list[float]:
        """Return theta of an interior extremum, before and after which the signal may cross its level.

        It is the extremum of the cubic through values and rates at both ends, if the sign there differs from the sign
        at both ends. Signals without known rates (multipliers, reactions, energies) are only checked at the ends of
        steps.
        """
        if self.signal.kind not in ("y", "angle") or self.signal.rate < 0 or f0 * f1 <= 0:
            return []
        try:
            m0, m1 = (step.h * rate[self.signal.rate] for rate in self._rates(step))
        except StepError:
            return []
        if m0 * f0 >= 0 or m1 * f1 <= 0:  # the signal does not approach the level and recede from it
            return []
        # p(x) = f0 + m0 x + a x^2 + b x^3, p'(x) = m0 + 2 a x + 3 b x^2, where m0 and m1 have opposite signs
        a, b = 3 * (f1 - f0) - 2 * m0 - m1, 2 * (f0 - f1) + m0 + m1
        root = np.sqrt(a * a - 3 * b * m0)
        with np.errstate(divide="ignore"):  # the square may underflow
            x = float(-m0 / (a + np.copysign(root, -m0)))
        return [x] if 0 < x < 1 and (f0 + x * (m0 + x * (a + x * b))) * f0 < 0 else []

    def _rates(self, step: "StepMap") -> tuple[Array, Array]:
        s = self.system
        if self.signal.rate < s.nv:
            return s.split(step.y)[1], s.split(step.y1)[1]
        return step.rates()
