"""First guesses of periodic motions from runs that have nearly settled: where they were close to their end before."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...mechanism.equations.invariance import MotionPoint, shift_units, symmetries_of
from ...mechanism.equations.symmetry import Symmetry
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import INPUT_DIGITS, NEGLIGIBLE
from .period import is_autonomous, period_of_functions

NEAR_RETURN = 0.2  # fraction of the largest distance from the end of a run: where it was close to its end before
CLOSE_RETURN = 0.02  # fraction of the same: closest return of a run that has nearly settled
SAMPLES, REFINED, ZOOMS = 4000, 11, 8  # samples of a run, and of a return: in the end 1e-9 of the run apart
MAX_RETURNS = 50  # the last ones of a run
POINTS = 3  # points of a run at which symmetries are checked


class CycleStart(NamedTuple):
    """A guess of the start of a period.

    Attributes:
        t: time.
        y: state (n,).
        T: period in s; None if it is not known.
        symmetries: names of those along which the motion may advance; None if they are to be found.
    """

    t: float
    y: Array
    T: float | None
    symmetries: tuple[str, ...] | None


def start_from_run(sol: Solution, T: float | None, names: Sequence[str] | None) -> CycleStart:
    """Return a start in the last period of a run that has nearly settled, as far as possible from events.

    The distance between states is measured in rad, characteristic lengths and per period of the fastest motion,
    without the directions of symmetries. A period of functions of time, or a multiple of it, is exact.

    Raises:
        InputError: if the run was not near its end before.
        UnknownNameError: for an unknown symmetry.
    """
    mech, t, y = sol.mechanism, float(sol.nodes[0][-1]), sol.nodes[1][-1]
    found = symmetries_of(mech, points_of(sol)) if names is None else tuple(names)
    autonomous = is_autonomous(mech, t, y)
    if T is None:
        T = _last_return(sol, found) if autonomous else _multiple_of(period_of_functions(mech), sol, found)
    return CycleStart(*_between_events(sol, T), T, found)


def points_of(sol: Solution) -> list[MotionPoint]:
    """Return points of the second half of a run, in the middles of steps apart."""
    n = len(sol.nodes[0])
    at = sorted({int(i) for i in np.linspace(n / 2, n - 1, POINTS + 1)[1:]})
    return [MotionPoint(float(sol.nodes[0][i]), sol.nodes[1][i], sol.mode(i)) for i in at]


def _between_events(sol: Solution, T: float) -> tuple[float, Array]:
    """Return time and state of a node in the middle of the longest time without events in the last two periods."""
    ts, ys = sol.nodes[:2]
    jumps = {i for i, _ in [*sol.modes, *sol.resets] if i} | {i + 1 for i in np.flatnonzero(np.diff(ts) == 0)}
    events = sorted(i for i in jumps if ts[-1] - ts[i] <= 2 * T)
    if len(events) < 2 or sol.mechanism.resets:
        return float(ts[-1]), ys[-1]
    first, last = max(pairwise(events), key=lambda pair: ts[pair[1]] - ts[pair[0]])
    k = first + int(np.abs(ts[first:last] - (ts[first] + ts[last]) / 2).argmin())
    return float(ts[k]), ys[k]


def _multiple_of(T: float, sol: Solution, names: Sequence[str]) -> float:
    """Return the multiple of the period of functions of time after which a run was where it ends; T itself if none."""
    try:
        n = _last_return(sol, names) / T
    except InputError:
        return T
    return round(n) * T if round(n) and abs(n - round(n)) <= NEGLIGIBLE * round(n) else T


def _last_return(sol: Solution, names: Sequence[str]) -> float:
    """Return the time in s since a run was last where it ends.

    Raises:
        InputError: if it was not near its end before.
    """
    times = np.linspace(sol.t[0], sol.t[-1], SAMPLES)
    distance = _DistanceFrom(sol, sol.nodes[1][-1], Symmetry.named(sol.mechanism.system(), names))
    size = distance(times)
    middle = size[1:-1]
    falls = (middle < size[:-2]) & (middle <= size[2:]) & (middle < NEAR_RETURN * size.max())
    away = np.maximum.accumulate(size[::-1])[::-1] > 2 * NEAR_RETURN * size.max()  # the motion leaves afterwards
    lowest = np.flatnonzero(falls & away[1:-1])
    best = list[tuple[float, float]]()
    for i in (lowest + 1)[-MAX_RETURNS:]:
        low, high = times[i - 1], times[i + 1]
        for _ in range(ZOOMS):
            nearby = np.linspace(low, high, REFINED)
            sizes = distance(nearby)
            k = int(sizes.argmin())
            low, high = nearby[max(k - 1, 0)], nearby[min(k + 1, REFINED - 1)]
        best.append((float(sizes.min()), float(nearby[k])))
    least = min(best, default=(np.inf,))[0]
    if least > CLOSE_RETURN * size.max():
        raise InputError(
            f"the run of {sol.t[-1] - sol.t[0]:.6g} s does not come back to where it ends: give an estimate of the"
            " period, T, or a section, or a longer run that has settled"
        )
    latest = max(when for far, when in best if far <= 2 * least + INPUT_DIGITS * size.max())
    return float(times[-1] - latest)


class _DistanceFrom:
    """Distance of the states of a run from one of them, in rad, characteristic lengths and parts of the speeds."""

    def __init__(self, sol: Solution, y: Array, symmetries: Sequence[Symmetry]) -> None:
        mech = sol.mechanism
        self.sol, self.y, self.nq, self.nv, self.scales = sol, y, mech.nq, mech.nv, mech.coordinate_scales
        self.manifold, units = mech.manifold, shift_units(mech)
        self.shifting = np.flatnonzero(units)
        self.units = units[self.shifting]
        self.speeds = np.abs(sol.v).max(axis=0) + INPUT_DIGITS
        self.basis = np.zeros((self.nv, 0))
        if symmetries:
            w = np.column_stack([symmetry.direction(y[: self.nq]) for symmetry in symmetries])
            self.basis = np.linalg.qr(w / self.scales[:, None])[0]

    def __call__(self, times: Array) -> Array:
        """Return the distances at several times, (n,)."""
        found, nq = self.sol(times), self.nq
        moved = np.array([self.manifold.difference(self.y[:nq], q) for q in found.q])
        moved[:, self.shifting] -= self.units * np.round(moved[:, self.shifting] / self.units)
        moved /= self.scales
        moved -= moved @ self.basis @ self.basis.T
        faster = (found.v - self.y[nq : nq + self.nv]) / self.speeds
        return np.linalg.norm(np.hstack([moved, faster]), axis=1)
