"""Initial guesses of periodic motions from the returns of a nearly settled run to its final state."""

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

NEAR_RETURN = 0.2  # distance of a candidate return from the final state, as a fraction of the largest distance
CLOSE_RETURN = 0.02  # distance of the closest return of a nearly settled run, as such a fraction
SAMPLES, REFINED, ZOOMS = 4000, 11, 8  # samples of a run, and of a return in each of several refinements
MAX_RETURNS = 50  # number of last returns that are refined
POINTS = 3  # number of points of a run at which symmetries are checked


class CycleStart(NamedTuple):
    """A guess of the start of a period.

    Attributes:
        t: time.
        y: state (n,).
        T: period in s; None if it is not known.
        symmetries: names of the symmetries along which the motion may advance; None if they are to be detected.
    """

    t: float
    y: Array
    T: float | None
    symmetries: tuple[str, ...] | None


def start_from_run(sol: Solution, T: float | None, names: Sequence[str] | None) -> CycleStart:
    """Return a start in the last period of a run that has nearly settled, as far as possible from events.

    The distance between states is measured in rad, characteristic lengths and fractions of the largest speeds, without
    the directions of symmetries. A period of functions of time, or a multiple of it, is exact.

    Raises:
        InputError: if the run does not return to its final state.
        UnknownNameError: for an unknown symmetry.
    """
    mech, t, y = sol.mechanism, float(sol.nodes[0][-1]), sol.nodes[1][-1]
    found = symmetries_of(mech, points_of(sol)) if names is None else tuple(names)
    autonomous = is_autonomous(mech, t, y)
    if T is None:
        T = _last_return(sol, found) if autonomous else _multiple_of(period_of_functions(mech), sol, found)
    return CycleStart(*_between_events(sol, T), T, found)


def points_of(sol: Solution) -> list[MotionPoint]:
    """Return a few nodes of the second half of a run, evenly distributed."""
    n = len(sol.nodes[0])
    nodes = sorted({int(i) for i in np.linspace(n / 2, n - 1, POINTS + 1)[1:]})
    return [MotionPoint(float(sol.nodes[0][i]), sol.nodes[1][i], sol.mode(i)) for i in nodes]


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
    """Return the multiple of the period T of functions of time that is the time of the last return; T if none is."""
    try:
        n = _last_return(sol, names) / T
    except InputError:
        return T
    return round(n) * T if round(n) and abs(n - round(n)) <= NEGLIGIBLE * round(n) else T


def _last_return(sol: Solution, names: Sequence[str]) -> float:
    """Return the time in s since a run last passed its final state.

    Raises:
        InputError: if it does not return to its final state.
    """
    times = np.linspace(sol.t[0], sol.t[-1], SAMPLES)
    distance = _StateDistance(sol, sol.nodes[1][-1], Symmetry.named(sol.mechanism.system(), names))
    size = distance(times)
    middle = size[1:-1]
    is_minimum = (middle < size[:-2]) & (middle <= size[2:]) & (middle < NEAR_RETURN * size.max())
    away = np.maximum.accumulate(size[::-1])[::-1] > 2 * NEAR_RETURN * size.max()  # the motion leaves afterwards
    lowest = np.flatnonzero(is_minimum & away[1:-1])
    best = list[tuple[float, float]]()
    for i in (lowest + 1)[-MAX_RETURNS:]:
        low, high = times[i - 1], times[i + 1]
        for _ in range(ZOOMS):
            window = np.linspace(low, high, REFINED)
            sizes = distance(window)
            k = int(sizes.argmin())
            low, high = window[max(k - 1, 0)], window[min(k + 1, REFINED - 1)]
        best.append((float(sizes.min()), float(window[k])))
    least = min(best, default=(np.inf,))[0]
    if least > CLOSE_RETURN * size.max():
        raise InputError(
            f"the run of {sol.t[-1] - sol.t[0]:.6g} s does not return to its final state: give an estimate of the"
            " period, T, or a section, or a longer run that has settled"
        )
    latest = max(t for separation, t in best if separation <= 2 * least + INPUT_DIGITS * size.max())
    return float(times[-1] - latest)


class _StateDistance:
    """Distance of the states of a run from state y, in rad, characteristic lengths and fractions of largest speeds."""

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
        dq = np.array([self.manifold.difference(self.y[:nq], q) for q in found.q])
        dq[:, self.shifting] -= self.units * np.round(dq[:, self.shifting] / self.units)
        dq /= self.scales
        dq -= dq @ self.basis @ self.basis.T
        dv = (found.v - self.y[nq : nq + self.nv]) / self.speeds
        return np.linalg.norm(np.hstack([dq, dv]), axis=1)
