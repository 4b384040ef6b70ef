"""Location of the first guard root in a step, on steps of the method, so that the order is preserved."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...discovery import lazy_import
from ...errors import StepError
from ...mechanism.hybrid.switch import Guard
from ...system import Array
from ...tolerances import COINCIDENT, EVALUATION_ROUNDING, REAL, SOLUTION_ROUNDING, VISIBLE
from .level_crossing import ITERATIONS, SHARE, SHARP
from .load_resolution import QUARTERS, At, sample_points

if TYPE_CHECKING:
    from ...mechanism.hybrid.mode_point import ModePoint
    from ..step_map import StepMap

brentq = lazy_import("scipy.optimize", "brentq")
LATER = 1.05  # times the predicted flight from speed and acceleration: when a row after an impact is below zero
ROOT = VISIBLE  # of a bracket: a zero of a row after an impact that is closer to the start is the start itself
HALVINGS = 40  # towards the start of a step
NEWTON = 12  # iterations, of which three or four are needed


class TrackedGuard:
    """A guard that is tracked from step to step.

    Attributes:
        guard: the guard.
        unit: size of the guard's quantity in this mechanism: a length or angle, a speed, the largest force.
        size: largest magnitude so far.
        level: value at which it ends the mode: 0, or the value within rounding below it at which the mode began, until
            it rises above 0.
        back: predicted time, from its acceleration, at which a row closes again after an impact; nan if it does not.
    """

    def __init__(self, guard: Guard, point: "ModePoint") -> None:
        self.guard, f = guard, guard.value(point)
        self.unit = _unit(guard, point)
        self.size, self.level, self.back = abs(f), 0.0 if guard.loads else min(0.0, f), np.nan
        if guard.rate and guard.bend and f <= self.band and (speed := guard.rate(point)) > 0 > (a := guard.bend(point)):
            self.back = point.t - LATER * 2 * speed / a

    def move(self, point: "ModePoint") -> None:
        """Continue from the end of a step."""
        f = self.guard.value(point)
        self.size = max(self.size, abs(f))
        if f >= 0:
            self.level = 0.0

    def value(self, point: "ModePoint") -> float:
        """Return the guard minus its level."""
        return self.guard.value(point) - self.level

    @property
    def band(self) -> float:
        """Return the rounding error of the guard."""
        return EVALUATION_ROUNDING * (self.unit + self.size)


def _unit(guard: Guard, point: "ModePoint") -> float:
    mech = point.system.mechanism
    rows = mech.switches[guard.at].rows
    scale = float(mech.row_scales[rows[0]]) if rows else 1.0
    if guard.kind in ("touch", "pass"):
        return scale
    if guard.kind in ("rest", "step"):
        return scale * point.speed
    return 1.0 if guard.kind == "command" else point.rounding / SOLUTION_ROUNDING


def first_guard_root(
    guards: Sequence[TrackedGuard], step: "StepMap", at: At, thetas: Array = QUARTERS
) -> tuple[float, list[Guard]]:
    """Return the share of a step at which the first guards pass zero, and these; 2 and none if there are none.

    Args:
        guards: of the mode.
        step: the step.
        at: the point after a share of it.
        thetas: shares at which loads are sampled.
    """
    theta, fired = 2.0, list[Guard]()
    near = 4 * _sharp(step)
    waiting = [(guard, _below(guard, step, at, thetas)) for guard in guards]
    while True:
        if theta <= 1:  # guards that pass zero before, possibly more than once
            waiting = [(g, theta) for g in guards if g.guard not in fired and g.value(at(theta)) < -g.band]
        guard, high = next(((g, x) for g, x in waiting if x is not None), (None, None))
        if guard is None or high is None:
            return theta, fired
        found = _locate(guard, step, at, high)
        if not fired or found < theta - near:
            theta, fired = found, [guard.guard]
        elif found <= theta + near:
            fired.append(guard.guard)
        else:
            return theta, fired


def _sharp(step: "StepMap") -> float:
    """Return the tolerance of a zero, as a share of a step."""
    return SHARP * float(np.spacing(max(abs(step.t), abs(step.t1)))) / abs(step.h)


def _below(followed: TrackedGuard, step: "StepMap", at: At, thetas: Array) -> float | None:
    """Return a share of the step at which a guard is negative, for loads the first found; None if it is not."""
    band, guard = followed.band, followed.guard
    if guard.loads:
        for theta in sample_points(guard, at, thetas)[1:]:
            with suppress(StepError):
                if followed.value(at(float(theta))) < -band:
                    return float(theta)
        return None
    f1 = followed.value(at(1.0))
    if f1 < -band:
        return 1.0
    back = (followed.back - step.t) / step.h
    if 0 < back < 1 and followed.value(at(back)) < -band:
        return back
    if guard.rate is not None:
        r0, r1 = guard.rate(at(0.0)), guard.rate(at(1.0))
        if not r0 < 0 < r1:
            return None
        f0, h = followed.value(at(0.0)), abs(step.h)
        if _least(f0, f1, h * r0, h * r1) > 0.25 * min(f0, f1):
            return None
        rate = guard.rate
        theta = float(brentq(lambda x: rate(at(x)), 0.0, 1.0, xtol=COINCIDENT, rtol=COINCIDENT, maxiter=ITERATIONS))
        return theta if followed.value(at(theta)) < -band else None
    return None


def _least(f0: float, f1: float, m0: float, m1: float) -> float:
    """Return the least value of the cubic with values f and derivatives m at 0 and 1, at eight points."""
    x = np.linspace(0, 1, 9)
    values = f0 + x * (m0 + x * (3 * (f1 - f0) - 2 * m0 - m1 + x * (2 * (f0 - f1) + m0 + m1)))
    return float(values.min())


def _locate(followed: TrackedGuard, step: "StepMap", at: At, high: float) -> float:
    """Return the zero of a guard before a share of the step at which it is negative.

    If the rate is known, Newton's iteration starts at the zero of the cubic through values and rates; otherwise, and
    where it leaves the bracket, Brent's method is used. A guard that is zero at the start (a row after an impact) is
    divided by the share, which leaves its mean rate.
    """
    f0, guard, h = followed.value(at(0.0)), followed.guard, abs(step.h)
    on_guard = f0 <= followed.band
    sharp = _sharp(step)
    if guard.rate is not None:
        r0 = guard.rate(at(0.0))
        theta = _cubic_zero(max(f0, 0.0), followed.value(at(high)), high * h * r0, high * h * guard.rate(at(high)))
        theta, nearest, best = theta * high, 0.0, np.inf
        for _ in range(NEWTON):
            if not (ROOT * high if on_guard else 0.0) < theta < high:
                break
            f, derivative = followed.value(at(theta)), h * guard.rate(at(theta))
            if not derivative < 0 or not abs(f) < best:
                if best <= followed.band and not on_guard:
                    return nearest
                break
            nearest, best, move = theta, abs(f), f / derivative
            if abs(move) <= sharp + SHARE * theta:
                return theta
            theta -= move
    low = 0.0
    if on_guard:
        low = next((high / 2**k for k in range(1, HALVINGS) if followed.value(at(high / 2**k)) > 0), 0.0)
        if not low:
            return 0.0

    def value(theta: float) -> float:
        f = followed.value(at(theta)) if theta else f0
        return f / theta if on_guard else f

    return float(brentq(value, low, high, xtol=sharp, rtol=SHARE, maxiter=ITERATIONS))


def _cubic_zero(f0: float, f1: float, m0: float, m1: float) -> float:
    """Return the first zero in (0, 1) of the cubic with values f0 >= 0 > f1 and derivatives m at 0, 1; 1 if none."""
    c = [2 * (f0 - f1) + m0 + m1, 3 * (f1 - f0) - 2 * m0 - m1, m0]
    roots = np.roots([*c, f0] if f0 > 0 else c)
    real = [float(x.real) for x in roots if abs(x.imag) < REAL and 0 < x.real < 1]
    return min(real, default=1.0)
