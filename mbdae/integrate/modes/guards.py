"""Where the first guard of a mode passes zero in a step: located on shorter steps of the method, so that order survives."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from ...errors import StepError
from ...mechanism.modes.switch import Guard
from ..signal_events import ITERATIONS, SHARE, SHARP

if TYPE_CHECKING:
    from ...mechanism.modes.point import ModePoint
    from ..step_map import StepMap

BAND = 1e-13  # of the size of a guard: nearer to zero it is rounding
SAMPLES = (0.25, 0.5, 0.75)  # of a step: where multipliers are looked at
HALVINGS = 40  # towards the start of a step
At = Callable[[float], "ModePoint"]


def band(size: float) -> float:
    """How near to zero a guard is rounding: size is the largest magnitude of what it is made of."""
    return BAND * (1 + size)


def first(guards: tuple[Guard, ...], step: "StepMap", at: At, sizes: dict[int, float]) -> tuple[float, list[Guard]]:
    """Return the share of a step at which the first guards pass zero, and these; 2 and none where none does.

    Args:
        guards: of the mode.
        step: the step.
        at: the point after a share of it.
        sizes: the largest magnitude that each guard had, by its place.
    """
    theta, fired = 2.0, []
    for i, guard in enumerate(guards):
        high = _below(guard, step, at, band(sizes.get(i, 0.0)))
        if high is None:
            continue
        if theta <= 1 and high > theta and guard.value(at(theta)) >= -band(sizes.get(i, 0.0)):
            continue  # it passes later than another one
        found = _locate(guard, step, at, min(high, 1.0), band(sizes.get(i, 0.0)))
        near = SHARP * 4 * float(np.spacing(max(abs(step.t), abs(step.t1)))) / abs(step.h)
        if found < theta - near:
            theta, fired = found, [guard]
        elif found <= theta + near:
            fired.append(guard)
    return theta, fired


def _below(guard: Guard, step: "StepMap", at: At, band: float) -> float | None:
    """A share of the step at which a guard is negative; None where it is not."""
    f1 = guard.value(at(1.0))
    if f1 < -band:
        return 1.0
    if guard.rate is not None:
        r0, r1 = guard.rate(at(0.0)), guard.rate(at(1.0))
        if not r0 < 0 < r1:
            return None
        f0, h = guard.value(at(0.0)), abs(step.h)
        if _least(f0, f1, h * r0, h * r1) > 0.25 * min(f0, f1):
            return None
        rate = guard.rate
        theta = float(brentq(lambda x: rate(at(x)), 0.0, 1.0, xtol=1e-9, rtol=1e-9, maxiter=ITERATIONS))
        return theta if guard.value(at(theta)) < -band else None
    if guard.loads:
        for theta in SAMPLES:
            try:
                if guard.value(at(theta)) < -band:
                    return theta
            except StepError:
                continue
    return None


def _least(f0: float, f1: float, m0: float, m1: float) -> float:
    """The least value of the cubic with values f and slopes m at 0 and 1, at eight places."""
    x = np.linspace(0, 1, 9)
    values = f0 + x * (m0 + x * (3 * (f1 - f0) - 2 * m0 - m1 + x * (2 * (f0 - f1) + m0 + m1)))
    return float(values.min())


def _locate(guard: Guard, step: "StepMap", at: At, high: float, band: float) -> float:
    """The zero of a guard before a share of the step at which it is negative.

    A guard that is zero at the start (a row that was just struck) is divided by the share: what is left is its rate.
    """
    f0 = guard.value(at(0.0))
    low, power = 0.0, 0
    if f0 <= band:
        power = 1
        low = next((high / 2**k for k in range(1, HALVINGS) if guard.value(at(high / 2**k)) > 0), 0.0)
        if not low:
            return 0.0

    def value(theta: float) -> float:
        f = guard.value(at(theta)) if theta else f0
        return f / theta if power else f

    sharp = SHARP * float(np.spacing(max(abs(step.t), abs(step.t1)))) / abs(step.h)
    return float(brentq(value, low, high, xtol=sharp, rtol=SHARE, maxiter=ITERATIONS))
