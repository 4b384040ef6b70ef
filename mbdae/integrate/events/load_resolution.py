"""Sampling of loads within a step, and whether the step resolves them.

Sticking or resting rows have no local error, so steps would grow until a load peak falls between two samples. A step
resolves a load if a cubic fits five equidistant samples, up to a small share of the load's distance to its limit: 1 for
the utilisation of friction, 0 for a normal force.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...mechanism.hybrid.switch import Guard
from ...system import Array
from ...tolerances import REAL, VISIBLE

if TYPE_CHECKING:
    from ...mechanism.hybrid.mode_point import ModePoint
    from .guard_location import TrackedGuard

QUARTERS = np.linspace(0.0, 1.0, 5)  # of a step: sampling points of loads
QUARTIC = np.linalg.inv(np.vander(QUARTERS))  # coefficients of the quartic through five samples
FINEST = 64  # intervals of a step of fixed size
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # the fourth difference of samples
ROUGH = 0.05  # of the distance of a load to its limit: largest deviation from a cubic
NEAR_LIMIT = 0.02  # of the limit, or of the largest load: smallest distance considered
NEARLY = 0.1  # of the limit, or of the largest load: extrema this close are sampled
BESIDE = 0.1  # of five samples: distance beyond them in which an extremum counts
At = Callable[[float], "ModePoint"]


def loads_unresolved(guards: Sequence["TrackedGuard"], at: At, thetas: Array, step_size: float) -> float:
    """Return the ratio of unresolved loads to the tolerance; above 1 there are too few samples.

    Samples that may miss a double guard crossing are too few as well. The measure is of fourth order in their distance.

    Args:
        guards: of the mode.
        at: the point after a share of the step.
        thetas: shares of the step, equidistant, 4 k + 1 of them.
        step_size: the size of the step.
    """
    worst = 0.0
    for followed in guards:
        guard = followed.guard
        if guard.longest is not None:
            longest = min(guard.longest(at(theta)) for theta in (0.0, 1.0))
            worst = max(worst, (4 * step_size / (len(thetas) - 1) / longest) ** 4)
        if guard.load is not None:
            loads = _samples(guard, at, thetas)
            size, left = _left(guard, loads, VISIBLE * followed.size)
            bend = max(float(np.linalg.norm(FOURTH @ five)) for five in _fives(loads))
            if guard.kind == "slip" or bend > np.abs(FOURTH).sum() * at(0.0).rounding:
                worst = max(worst, bend / (size * ROUGH * max(left, NEAR_LIMIT)))
    return worst


def resolving_step(guards: Sequence["TrackedGuard"], at: At, step_size: float) -> Array:
    """Return shares of a step of fixed size at which loads are sampled: as many as resolve them."""
    thetas = QUARTERS
    with suppress(StepError):
        while len(thetas) <= FINEST and loads_unresolved(guards, at, thetas, step_size) > 1:
            thetas = np.linspace(0.0, 1.0, 2 * len(thetas) - 1)
    return thetas


def sample_points(guard: Guard, at: At, thetas: Array) -> Array:
    """Return the samples, and the points of closest approach to the limit of quartics through five each."""
    found = list(thetas)
    with suppress(StepError):
        loads = _samples(guard, at, thetas) if guard.load else np.empty((0, 1))
        slips, size = guard.kind == "slip", float(np.abs(loads).max(initial=0.0)) or 1.0
        for k, five in enumerate(_fives(loads / size)):
            quartics = (QUARTIC @ five).T
            near = np.sum([np.convolve(c, c) for c in quartics], axis=0) if slips else quartics[0]
            for x in np.roots(np.polyder(near)):
                if abs(x.imag) < REAL and -BESIDE < x.real < 1 + BESIDE:
                    value = float(np.polyval(near, x.real))
                    if size * np.sqrt(max(value, 0.0)) > 1 - NEARLY if slips else value < NEARLY:
                        found.append(float(np.clip((k + x.real) * 4 / (len(thetas) - 1), 0.0, 1.0)))
    return np.unique(found)


def _samples(guard: Guard, at: At, thetas: Array) -> Array:
    """Return the loads of a guard at shares of a step, (n, k)."""
    assert guard.load
    return np.array([np.atleast_1d(guard.load(at(float(theta)))) for theta in thetas])


def _fives(loads: Array) -> list[Array]:
    """Return samples by fives, sharing their end points."""
    return [loads[k : k + 5] for k in range(0, len(loads) - 1, 4)]


def _left(guard: Guard, loads: Array, least: float) -> tuple[float, float]:
    """Return the size of a load, and its distance to the limit as a share of that; 1 beyond the limit."""
    sizes = np.linalg.norm(loads, axis=1)
    size = 1.0 if guard.kind == "slip" else max(float(sizes.max()), least)
    left = 1.0 - float(sizes.max()) if guard.kind == "slip" else float(loads.min()) / (size or 1.0)
    return size, left if left >= 0 else 1.0
