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
FINEST = 64  # largest number of sampling intervals in a step of fixed size
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # the fourth difference of samples
ROUGH = 0.05  # fraction of the distance of a multiplier to its limit: largest deviation from a cubic
NEAR_LIMIT = 0.02  # fraction of the limit, or of the largest multiplier: lower bound of this distance
CLOSE_EXTREMUM = 0.1  # fraction of the limit, or of the largest multiplier: extrema this close to the limit are sampled
OUTSIDE = 0.1  # fraction of the range of five samples: extrema this far outside the range are included
SAFETY, SHRINK = 0.8, 0.2  # fraction of the largest step that resolves multipliers; smallest ratio of step sizes
SHORTEST_STEP = SMALLEST_PART  # fraction of the span: multipliers that are not resolved by steps of this size are jumps
PointAt = Callable[[float], ModePoint]


def interpolated_points(step: "StepMap", at: PointAt) -> PointAt:
    """Return a function of theta that returns points on the cubic through both ends and their rates, evaluated once."""

    @cache
    def cubic() -> Array:
        start, end = at(0.0), at(1.0)
        rates = step.h * start.derivative[0], step.h * end.derivative[0]
        move = start.system.difference(start.y, end.y)
        return hermite.fit([(np.zeros_like(move), move), rates], np.empty((0, len(move))))

    @cache
    def between(theta: float) -> ModePoint:
        start = at(0.0)
        y = start.system.add(start.y, hermite.powers(theta, 3) @ cubic())
        return ModePoint(start.system, start.all_rows, step.t + theta * step.h, y)

    return lambda theta: between(theta) if 0 < theta < 1 else at(theta)


def shortest_step(run: "RunState") -> float:
    """Return the size of the steps of a run that resolve all multipliers, in s."""
    return SHORTEST_STEP * abs(run.t1 - run.ts[0])


def resolution_error(guards: Sequence["TrackedGuard"], at: PointAt, thetas: Array, step_size: float) -> float:
    """Return the largest deviation of a multiplier from a cubic over the tolerance; above 1, more samples are needed.

    Samples that may miss a double crossing of a guard count, too. It is of fourth order in the distance of the samples.

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
            bend = max(float(np.linalg.norm(FOURTH @ five)) for five in _groups_of_five(samples))
            if guard.kind == "slip" or bend > np.abs(FOURTH).sum() * at(0.0).rounding:
                worst = max(worst, bend / (size * ROUGH * max(distance, NEAR_LIMIT)))
    return worst


def resolving_step(guards: Sequence["TrackedGuard"], at: PointAt, step_size: float) -> Array:
    """Return the values of theta at which multipliers are sampled in a step of fixed size: enough to resolve them."""
    thetas = QUARTERS
    with suppress(StepError):
        while len(thetas) <= FINEST and resolution_error(guards, at, thetas, step_size) > 1:
            thetas = np.linspace(0.0, 1.0, 2 * len(thetas) - 1)
    return thetas


def sample_points(guard: Guard, at: PointAt, thetas: Array) -> Array:
    """Return the samples, and the extrema, close to the limit, of the quartics through five samples each."""
    points = list(thetas)
    with suppress(StepError):
        samples = _samples(guard, at, thetas) if guard.monitored_multiplier else np.empty((0, 1))
        slips, size = guard.kind == "slip", float(np.abs(samples).max(initial=0.0)) or 1.0
        for k, five in enumerate(_groups_of_five(samples / size)):
            quartics = (QUARTIC @ five).T
            polynomial = np.sum([np.convolve(c, c) for c in quartics], axis=0) if slips else quartics[0]
            for x in np.roots(np.polyder(polynomial)):
                if abs(x.imag) < REAL and -OUTSIDE < x.real < 1 + OUTSIDE:
                    value = float(np.polyval(polynomial, x.real))
                    if size * np.sqrt(max(value, 0.0)) > 1 - CLOSE_EXTREMUM if slips else value < CLOSE_EXTREMUM:
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
    """Return the size of a multiplier, and its distance to the limit relative to the size; 1 beyond the limit."""
    sizes = np.linalg.norm(samples, axis=1)
    size = 1.0 if guard.kind == "slip" else max(float(sizes.max()), smallest)
    distance = 1.0 - float(sizes.max()) if guard.kind == "slip" else float(samples.min()) / (size or 1.0)
    return size, distance if distance >= 0 else 1.0


def multipliers_after_short_step(run: "RunState", point: ModePoint) -> "MultipliersAfterStep":
    """Return a function that computes lam after a step in a mode, which is a fraction of the smooth interval."""

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
