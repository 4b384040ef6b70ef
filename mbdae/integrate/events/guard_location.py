"""Location of the first root of guards in a step, on shorter steps of the method, so that it has its order."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...mechanism.hybrid.switch import Guard
from ...system import Array
from ...tolerances import COINCIDENT, EVALUATION_ROUNDING, REAL, SOLUTION_ROUNDING, VISIBLE
from .level_crossing import MAX_ITERATIONS, RELATIVE_TOLERANCE, TIME_SPACINGS
from .multiplier_resolution import QUARTERS, PointAt, sample_points

if TYPE_CHECKING:
    from ...mechanism.hybrid.mode_point import ModePoint
    from ..run.step_map import StepMap

brentq = lazy_import("scipy.optimize", "brentq")
RETURN_FACTOR = 1.05  # times the flight time predicted from speed and acceleration: afterwards the gap is negative
START_ROOT = VISIBLE  # fraction of a bracket: after an impact, a root this close to the start is the start itself
GRAZING = 0.25  # fraction of the smaller gap at the ends of a step: a larger minimum is no contact
MAX_HALVINGS = 40  # halvings of a step, towards its start
MAX_NEWTON = 12  # iterations; three or four are typical


class TrackedGuard:
    """A guard that is tracked from step to step.

    Attributes:
        guard: the guard.
        unit: typical size of the guard in this mechanism: a length or angle, a speed, the largest force.
        size: largest magnitude so far.
        level: value at which the guard ends the mode: 0; until the guard becomes positive, its initial value if that is
            negative by rounding.
        return_time: time shortly after the next contact of a row after an impact, predicted from speed and
            acceleration; nan if none is predicted.
    """

    def __init__(self, guard: Guard, point: "ModePoint") -> None:
        self.guard, f = guard, guard.value(point)
        self.unit = guard_unit(guard, point)
        self.size, self.level, self.return_time = abs(f), 0.0 if guard.needs_multipliers else min(0.0, f), np.nan
        if (
            guard.rate
            and guard.second_rate
            and f <= self.rounding
            and (speed := guard.rate(point)) > 0 > (a := guard.second_rate(point))
        ):
            self.return_time = point.t - RETURN_FACTOR * 2 * speed / a

    @classmethod
    def without_state(cls, guard: Guard, point: "ModePoint") -> "TrackedGuard":
        """Return a guard whose state the core sets next; evaluate it, since some guards refer to their first value."""
        out = cls.__new__(cls)
        out.guard = guard
        if not guard.needs_multipliers:
            guard.value(point)
        return out

    def advance(self, point: "ModePoint") -> None:
        """Update size and level at the end of a step."""
        f = self.guard.value(point)
        self.size = max(self.size, abs(f))
        if f >= 0:
            self.level = 0.0

    def value(self, point: "ModePoint") -> float:
        """Return the guard minus its level."""
        return self.guard.value(point) - self.level

    @property
    def rounding(self) -> float:
        """Rounding error of the guard."""
        return EVALUATION_ROUNDING * (self.unit + self.size)


def guard_unit(guard: Guard, point: "ModePoint") -> float:
    """Return the typical size of a guard: a length or angle, a speed, 1 for a command, or the largest force."""
    mech = point.system.mechanism
    rows = mech.switches[guard.switch].rows
    scale = float(mech.row_scales[rows[0]]) if rows else 1.0
    if guard.kind in ("contact", "range boundary"):
        return scale
    if guard.kind in ("zero velocity", "speed step"):
        return scale * point.speed
    return 1.0 if guard.kind == "command" else point.rounding / SOLUTION_ROUNDING


def first_guard_root(
    guards: Sequence[TrackedGuard], step: "StepMap", at: PointAt, thetas: Array = QUARTERS
) -> tuple[float, list[Guard]]:
    """Return theta in [0, 1] at which the first guards cross zero, and these guards; (2, []) if none does.

    Args:
        guards: the guards of the mode.
        step: the step.
        at: function of theta that returns the point there.
        thetas: values of theta at which multipliers are sampled.
    """
    theta, fired = 2.0, list[Guard]()
    tolerance = 4 * _time_tolerance(step)
    candidates = [(guard, _negative_fraction(guard, step, at, thetas)) for guard in guards]
    while True:
        if theta <= 1:  # guards that cross zero before theta, possibly more than once
            candidates = [(g, theta) for g in guards if g.guard not in fired and g.value(at(theta)) < -g.rounding]
        guard, high = next(((g, x) for g, x in candidates if x is not None), (None, None))
        if guard is None or high is None:
            return theta, fired
        root = _locate(guard, step, at, high)
        if not fired or root < theta - tolerance:
            theta, fired = root, [guard.guard]
        elif root <= theta + tolerance:
            fired.append(guard.guard)
        else:
            return theta, fired


def _time_tolerance(step: "StepMap") -> float:
    """Return the tolerance of the time of a root, relative to the step."""
    return TIME_SPACINGS * float(np.spacing(max(abs(step.t), abs(step.t1)))) / abs(step.h)


def _negative_fraction(tracked: TrackedGuard, step: "StepMap", at: PointAt, thetas: Array) -> float | None:
    """Return a theta at which a guard is negative, the first sample for multipliers; None if it stays positive."""
    rounding, guard = tracked.rounding, tracked.guard
    if guard.needs_multipliers:
        for theta in sample_points(guard, at, thetas)[1:]:
            with suppress(StepError):
                if tracked.value(at(float(theta))) < -rounding:
                    return float(theta)
        return None
    f1 = tracked.value(at(1.0))
    if f1 < -rounding:
        return 1.0
    return_theta = (tracked.return_time - step.t) / step.h
    if 0 < return_theta < 1 and tracked.value(at(return_theta)) < -rounding:
        return return_theta
    return _lowest_fraction(tracked, step, at) if guard.rate is not None else None


def _lowest_fraction(tracked: TrackedGuard, step: "StepMap", at: PointAt) -> float | None:
    """Return the theta of a negative minimum of a guard within a step, at whose end it rises; None if there is none."""
    rate, h, f0, f1 = tracked.guard.rate, abs(step.h), tracked.value(at(0.0)), tracked.value(at(1.0))
    assert rate is not None
    r0, r1 = rate(at(0.0)), rate(at(1.0))
    if not r1 > 0:
        return None
    b, c, m0 = 3 * (f1 - f0) - h * (2 * r0 + r1), 2 * (f0 - f1) + h * (r0 + r1), h * r0
    discriminant = b * b - 3 * c * m0
    falls = b < 0 < c and discriminant > 0 and -b < 3 * c  # the cubic falls within the step
    if r0 >= 0 and not falls:
        return None
    root = np.sqrt(max(0.0, discriminant))
    x = -m0 / (b + root) if b >= 0 else (root - b) / (3 * c)  # root of m0 + 2 b x + 3 c x^2, where it rises
    if f0 + x * (m0 + x * (b + x * c)) > GRAZING * min(f0, f1):
        return None
    falling_point = 0.0 if r0 < 0 else -b / (3 * c)  # theta of the steepest descent of the cubic
    if not rate(at(falling_point)) < 0:
        return None
    theta = brentq(lambda x: rate(at(x)), falling_point, 1.0, xtol=COINCIDENT, rtol=COINCIDENT, maxiter=MAX_ITERATIONS)
    return float(theta) if tracked.value(at(float(theta))) < -tracked.rounding else None


def _locate(tracked: TrackedGuard, step: "StepMap", at: PointAt, high: float) -> float:
    """Return the root of a guard before a theta at which it is negative.

    If the rate is known, Newton's iteration starts at the root of the cubic through values and rates; otherwise, or if
    an iterate leaves the bracket, Brent's method is used. A guard that is zero at the start (a row after an impact) is
    divided by theta, which gives its mean rate.
    """
    f0, guard, h = tracked.value(at(0.0)), tracked.guard, abs(step.h)
    starts_at_zero = f0 <= tracked.rounding
    tolerance = _time_tolerance(step)
    if guard.rate is not None:
        r0 = guard.rate(at(0.0))
        theta = _cubic_zero(max(f0, 0.0), tracked.value(at(high)), high * h * r0, high * h * guard.rate(at(high)))
        theta, nearest, best = theta * high, 0.0, np.inf
        for _ in range(MAX_NEWTON):
            if not (START_ROOT * high if starts_at_zero else 0.0) < theta < high:
                break
            f, derivative = tracked.value(at(theta)), h * guard.rate(at(theta))
            if not derivative < 0 or not abs(f) < best:
                if best <= tracked.rounding:
                    return nearest
                break
            nearest, best, change = theta, abs(f), f / derivative
            if abs(change) <= tolerance + RELATIVE_TOLERANCE * theta:
                return theta
            theta -= change
    low = 0.0
    if starts_at_zero:
        low = next((high / 2**k for k in range(1, MAX_HALVINGS) if tracked.value(at(high / 2**k)) > 0), 0.0)
        if not low:
            return 0.0

    def value(theta: float) -> float:
        f = tracked.value(at(theta)) if theta else f0
        return f / theta if starts_at_zero else f

    return float(brentq(value, low, high, xtol=tolerance, rtol=RELATIVE_TOLERANCE, maxiter=MAX_ITERATIONS))


def _cubic_zero(f0: float, f1: float, m0: float, m1: float) -> float:
    """Return the first root in (0, 1) of the cubic with values f0 >= 0 > f1 and derivatives m at 0, 1; 1 if none."""
    c = [2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1, m0]
    roots = np.roots([*c, f0] if f0 > 0 else c)
    real = [float(x.real) for x in roots if abs(x.imag) < REAL and 0 < x.real < 1]
    return min(real, default=1.0)
