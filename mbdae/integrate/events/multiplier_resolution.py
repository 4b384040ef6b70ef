"""Sampling of multipliers within a step, and a check that the step resolves them.

Sticking or closed rows cause no local error, so steps would grow until a peak of a multiplier falls between two
samples. A step resolves a monitored multiplier (`Guard.monitored_multiplier`) if a cubic fits five equidistant samples,
up to a small fraction of its distance to its limit: 1 for the utilization of friction, 0 for a normal force. For this
check, points between the ends of the step are on the cubic through both ends and their rates.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ... import hermite
from ...errors import StepError
from ...mechanism.hybrid.mode_point import ModePoint
from ...mechanism.hybrid.switch import Guard
from ...system import Array, State
from ...tolerances import REAL, SMALLEST_PART, VISIBLE

if TYPE_CHECKING:
    from ...mechanism.hybrid.switches import Mode
    from ...mechanism.hybrid.undecided_rows import MultipliersAfterStep
    from ..run.run_state import RunState
    from ..run.step_map import StepMap
    from .guard_location import TrackedGuard

QUARTERS = np.linspace(0.0, 1.0, 5)  # fractions of a step: sampling points of multipliers
QUARTIC = np.linalg.inv(np.vander(QUARTERS))  # coefficients of the quartic through five samples
MAX_INTERVALS = 64  # largest number of sampling intervals in a step of fixed size
FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # the fourth difference of samples
MAX_DEVIATION = 0.05  # fraction of the distance of a multiplier from its limit: largest deviation from a cubic
MIN_DISTANCE = 0.02  # fraction of the limit, or of the largest multiplier: lower bound of the distance
CLOSE_EXTREMUM = 0.1  # fraction of the limit, or of the largest multiplier: extrema this close to the limit are sampled
RANGE_MARGIN = 0.1  # fraction of the range of five samples: extrema up to this far outside are included
SAFETY, SHRINK = 0.8, 0.2  # fraction of the largest step that resolves multipliers; smallest ratio of step sizes
SHORTEST_STEP = SMALLEST_PART  # fraction of the span: multipliers that are not resolved by steps of this size are jumps
PointAt = Callable[[float], ModePoint]


def interpolated_points(step: "StepMap", at: PointAt) -> PointAt:
    """Return a function of theta that returns points on the cubic through both ends and their rates, evaluated once."""

    @cache
    def cubic() -> Array:
        start, end = at(0.0), at(1.0)
        rates = step.h * start.derivative[0], step.h * end.derivative[0]
        displacement = start.system.difference(start.y, end.y)
        return hermite.fit([(np.zeros_like(displacement), displacement), rates], np.empty((0, len(displacement))))

    @cache
    def interpolated(theta: float) -> ModePoint:
        start = at(0.0)
        y = start.system.add(start.y, hermite.powers(theta, 3) @ cubic())
        return ModePoint(start.system, start.all_rows, step.t + theta * step.h, y)

    return lambda theta: interpolated(theta) if 0 < theta < 1 else at(theta)


def shortest_step(run: "RunState") -> float:
    """Return the step size of a run, in s, that is assumed to resolve all multipliers."""
    return SHORTEST_STEP * abs(run.t1 - run.ts[0])


def resolution_error(guards: Sequence["TrackedGuard"], at: PointAt, thetas: Array, step_size: float) -> float:
    """Return the largest ratio of the deviation of a multiplier from a cubic to its tolerance.

    Above 1, more samples are needed. Samples that may miss a double crossing of a guard also count. The deviation has
    order 4 in the sample spacing.

    Args:
        guards: the guards of the mode.
        at: function of theta that returns an interpolated point there.
        thetas: 4 k + 1 equidistant values of theta.
        step_size: the size of the step.
    """
    worst = 0.0
    for tracked in guards:
        guard = tracked.guard
        if guard.max_step is not None:
            max_step = min(guard.max_step(at(theta)) for theta in (0.0, 1.0))
            worst = max(worst, (4 * step_size / (len(thetas) - 1) / max_step) ** 4)
        if guard.monitored_multiplier is not None:
            samples = _samples(guard, at, thetas)
            size, distance = _distance_to_limit(guard, samples, VISIBLE * tracked.size)
            deviation = max(float(np.linalg.norm(FOURTH_DIFFERENCE @ group)) for group in _groups_of_five(samples))
            if guard.kind == "slip" or deviation > np.abs(FOURTH_DIFFERENCE).sum() * at(0.0).rounding:
                worst = max(worst, deviation / (size * MAX_DEVIATION * max(distance, MIN_DISTANCE)))
    return worst


def resolving_samples(guards: Sequence["TrackedGuard"], at: PointAt, step_size: float) -> Array:
    """Return the values of theta at which multipliers are sampled in a step of fixed size: enough to resolve them."""
    thetas = QUARTERS
    with suppress(StepError):
        while len(thetas) <= MAX_INTERVALS and resolution_error(guards, at, thetas, step_size) > 1:
            thetas = np.linspace(0.0, 1.0, 2 * len(thetas) - 1)
    return thetas


def sample_points(guard: Guard, at: PointAt, thetas: Array) -> Array:
    """Return the samples, and those extrema of the quartics through five samples each that are close to the limit."""
    points = list(thetas)
    with suppress(StepError):
        samples = _samples(guard, at, thetas) if guard.monitored_multiplier else np.empty((0, 1))
        is_slip, size = guard.kind == "slip", float(np.abs(samples).max(initial=0.0)) or 1.0
        for k, group in enumerate(_groups_of_five(samples / size)):
            quartics = (QUARTIC @ group).T
            polynomial = np.sum([np.convolve(c, c) for c in quartics], axis=0) if is_slip else quartics[0]
            for x in np.roots(np.polyder(polynomial)):
                if abs(x.imag) < REAL and -RANGE_MARGIN < x.real < 1 + RANGE_MARGIN:
                    value = float(np.polyval(polynomial, x.real))
                    if size * np.sqrt(max(value, 0.0)) > 1 - CLOSE_EXTREMUM if is_slip else value < CLOSE_EXTREMUM:
                        points.append(float(np.clip((k + x.real) * 4 / (len(thetas) - 1), 0.0, 1.0)))
    return np.unique(points)


def _samples(guard: Guard, at: PointAt, thetas: Array) -> Array:
    """Return the monitored multiplier of a guard at the given values of theta, (n, m)."""
    assert guard.monitored_multiplier
    return np.array([np.atleast_1d(guard.monitored_multiplier(at(float(theta)))) for theta in thetas])


def _groups_of_five(samples: Array) -> list[Array]:
    """Return groups of five samples that share their end points."""
    return [samples[k : k + 5] for k in range(0, len(samples) - 1, 4)]


def _distance_to_limit(guard: Guard, samples: Array, smallest: float) -> tuple[float, float]:
    """Return the size of a multiplier, and its distance from the limit relative to the size; 1 beyond the limit."""
    sizes = np.linalg.norm(samples, axis=1)
    size = 1.0 if guard.kind == "slip" else max(float(sizes.max()), smallest)
    distance = 1.0 - float(sizes.max()) if guard.kind == "slip" else float(samples.min()) / (size or 1.0)
    return size, distance if distance >= 0 else 1.0


def multipliers_after_short_step(run: "RunState", point: ModePoint) -> "MultipliersAfterStep":
    """Return a function that computes lam in a mode after a step by a fraction of the smooth interval."""

    def step(mode: "Mode", fraction: float) -> tuple[Array, float]:
        system, before = point.system, point.system.mode
        system.enter(mode)
        try:
            h = fraction * (run.jumps.interval(point.t).stop - point.t)
            start = system.update_independent_rows(point.t, State(point.y)).y
            carry = system.carry(*system.derivative(point.t, start))
            end = run.tableau.step(system, point.t, h, State(start, carry)).state.y
            after = ModePoint(system, point.all_rows, point.t + h, end)
            return after.lam, after.rounding
        finally:
            system.enter(before)

    return step
