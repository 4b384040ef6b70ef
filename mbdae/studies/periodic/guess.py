"""First guesses of periodic motions: the period, full turns and advances, from runs."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import e
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.equations.symmetry import Symmetry
from ...mechanism.formulations.equation_partials import time_partials
from ...mechanism.time_functions.time_functions import Harmonic
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import INPUT_DIGITS
from .exchange import Exchange
from .flow import Flow
from .shooting import TWO_PI, Cycle, Guess

SAMPLED_TIMES = 3  # at which time dependence is checked
MAX_EVENTS = 9  # at the start of a run, between which a period with several events begins
MAX_MULTIPLE = 64  # of the shortest of several periods of drivers
NEAR_RETURN = 0.2  # of the largest distance from the end of a run: where it was close to its end before
SAMPLES, REFINED, ZOOMS = 4000, 11, 8  # of a run, and of a return: in the end 1e-9 of the run apart
NO_JOINTS: Mapping[str, str] = MappingProxyType({})
MAX_RETURNS = 50  # the last ones of a run


def guess_of(
    flow: Flow,
    y: Array,
    T: float | None,
    t: float,
    section: str | None,
    names: Sequence[str],
    parts: int | None,
    joints: Mapping[str, str] = NO_JOINTS,
) -> tuple[Cycle, Guess]:
    """Return the kind of a motion and its first guess.

    Raises:
        InputError: without an estimate of the period, or for wrong values.
        UnknownNameError: for an unknown symmetry.
    """
    mech = flow.mechanism
    exchange = Exchange(mech, joints)
    k = _number_of_parts(parts, section)
    symmetries, free = Symmetry.named(mech.system(), names), is_autonomous(mech, t, y)
    if section:
        y, T = _on_section(flow, t, y, T or mech.duration, section)
    elif mech.resets and free:
        y, T = _between_events(flow, t, y, T)
    elif not free:
        T = T or _period_of_drivers(mech)
    if T is None:
        raise InputError("the equations do not depend on time: give an estimate of the period, T, or a section")
    cycle = Cycle(t, k, section, not free and not section, free, symmetries, exchange)
    *nodes, end = _nodes(flow, cycle, y, T)
    return cycle, Guess(nodes, T, *_advances(mech, symmetries, y[: mech.nq], exchange.moved(end[: mech.nq])))


def _nodes(flow: Flow, cycle: Cycle, y: Array, T: float) -> list[Array]:
    """Return the points between the parts of a period, from its start to its end, (k + 1,)."""
    k, out = cycle.parts, [y]
    for i in range(k):
        out.append(flow.run(cycle.t + i * T / k, out[-1], T / k, cycle.section if i == k - 1 else None).y[-1])
    return out


def _number_of_parts(parts: int | None, section: str | None) -> int:
    """Return the number of parts of a period.

    Raises:
        InputError: for a number that is not possible.
    """
    if parts is not None and (isinstance(parts, bool) or not isinstance(parts, int) or parts < 1):
        raise InputError(f"parts must be a positive number, got {parts!r:.60}")
    if section and parts == 1:
        raise InputError("a motion with a section has at least 2 parts: the section is not monitored in the first one")
    return parts or (2 if section else 1)


def _advances(mech: Mechanism, symmetries: Sequence[Symmetry], q: Array, end: Array) -> tuple[Array, Array]:
    """Return the motions (m,) along symmetries that lead from an end back to q, and full turns (nv,) of joints."""
    moved, angles, turns = mech.manifold.difference(q, end), _revolute(mech), np.zeros(mech.nv)
    turns[angles] = np.round(moved[angles] / TWO_PI)
    if not symmetries:
        return np.zeros(0), turns
    w = np.column_stack([symmetry.direction(q) for symmetry in symmetries])
    turns[np.abs(w).max(axis=1) > 0] = 0.0
    return -np.linalg.lstsq(w, moved - TWO_PI * turns, rcond=None)[0], turns


def is_autonomous(mech: Mechanism, t: float, y: Array) -> bool:
    """Return whether forces and drivers do not depend on time, judged at several times."""
    system = mech.system()
    (q, v), inner = system.split(y), system.element_states(y)
    for k in range(SAMPLED_TIMES):
        at = t + k * mech.duration / e
        by_time = system.g_t(at), *time_partials(system, at, q, v, inner, np.zeros(mech.ng))
        if any(x.any() for x in by_time):
            return False
    return True


def _on_section(flow: Flow, t: float, y: Array, longest: float, section: str) -> tuple[Array, float]:
    """Return the first point of a motion on the section, and the time until it is there again."""
    first = flow.run(t, y, longest, section)
    start = first.y[0] if first.t[-1] == first.t[0] else first.y[-1]
    again = flow.run(t, start, longest, section)
    return start, float(again.t[-1] - again.t[0])


def _between_events(flow: Flow, t: float, y: Array, T: float | None) -> tuple[Array, float]:
    """Return a point half-way between two events at which the state jumps, and the time from one to the next, or T.

    Shooting starts there, since an event at the end of a part would be lost or taken twice.

    Raises:
        InputError: if there are no two events.
    """
    mech = flow.mechanism
    sol = flow.run(t, y, max(2.5 * T if T else 0.0, mech.duration), None)
    times = [float(sol.nodes[0][i]) for i, _ in sol.resets]
    if len(times) < 2:
        names = ", ".join(repr(reset.name) for reset in mech.resets)
        raise InputError(f"{names}: fewer than two events within {sol.t[-1]:.3g} s; start closer to a periodic motion")
    first, second = max(pairwise(times[:MAX_EVENTS]), key=lambda pair: pair[1] - pair[0]) if T else times[:2]
    return flow.run(t, y, (first + second) / 2 - t, None).y[-1], T or second - first


def _period_of_drivers(mech: Mechanism) -> float:
    """Return the common period of the harmonic functions of drivers and forces.

    Raises:
        InputError: for other functions of time, or frequencies without a small common multiple.
    """
    omegas = sorted({abs(x.omega) for x in _harmonics([*mech.drivers, *mech.forces])} - {0.0})
    if not omegas:
        raise InputError("forces or drivers depend on time, but not as harmonic functions: give their period, T")
    for n in range(1, MAX_MULTIPLE + 1):
        T = n * TWO_PI / omegas[0]
        cycles = np.array(omegas) * T / TWO_PI
        if np.abs(cycles - np.round(cycles)).max() <= INPUT_DIGITS:
            return T
    raise InputError("the frequencies of forces and drivers have no common period: give T")


def _harmonics(values: Any) -> list[Harmonic]:
    """Return the harmonic functions in tables of drivers and forces."""
    if isinstance(values, Harmonic):
        return [values]
    if hasattr(type(values), "model_fields"):
        values = [getattr(values, name) for name in type(values).model_fields]
    return [x for value in values for x in _harmonics(value)] if isinstance(values, list | tuple) else []


def _revolute(mech: Mechanism) -> Array:
    """Return indices in v of revolute joints whose angle is a coordinate."""
    joints = [j for j in mech.model.joints if (j.nq, j.nv) == (1, 1)]
    return np.array([j.idx_v for j in joints if j.shortname().removeprefix("JointModel").startswith("R")], int)


def start_from_run(sol: Solution, T: float | None, names: Sequence[str]) -> tuple[float, Array, float]:
    """Return the end of a run that has nearly settled, its time, and the time since it was there before.

    The distance between states is measured in rad, characteristic lengths and per period of the fastest motion,
    without the directions of symmetries.

    Raises:
        InputError: if the run was not near its end before.
        UnknownNameError: for an unknown symmetry.
    """
    mech, t, y = sol.mechanism, float(sol.nodes[0][-1]), sol.nodes[1][-1]
    if T is not None:
        return t, y, T
    system = mech.system()
    symmetries = Symmetry.named(system, names)
    times = np.linspace(sol.t[0], sol.t[-1], SAMPLES)
    distance = _DistanceFrom(sol, y, symmetries)
    size = distance(times)
    middle = size[1:-1]
    falls = (middle < size[:-2]) & (middle <= size[2:]) & (middle < NEAR_RETURN * size.max())
    away = np.maximum.accumulate(size[::-1])[::-1] > 2 * NEAR_RETURN * size.max()  # the motion leaves afterwards
    lowest = np.flatnonzero(falls & away[1:-1])
    if not len(lowest):
        raise InputError("the run does not come back to where it ends: give T or a section, or a longer run")
    best = []
    for i in (lowest + 1)[-MAX_RETURNS:]:
        low, high = times[i - 1], times[i + 1]
        for _ in range(ZOOMS):
            nearby = np.linspace(low, high, REFINED)
            sizes = distance(nearby)
            k = int(sizes.argmin())
            low, high = nearby[max(k - 1, 0)], nearby[min(k + 1, REFINED - 1)]
        best.append((float(sizes.min()), float(nearby[k])))
    least = min(best)[0]
    latest = max(when for far, when in best if far <= 2 * least + INPUT_DIGITS * size.max())
    return t, y, float(times[-1] - latest)


class _DistanceFrom:
    """Distance of the states of a run from one of them, in rad, characteristic lengths and parts of the speeds."""

    def __init__(self, sol: Solution, y: Array, symmetries: Sequence[Symmetry]) -> None:
        mech = sol.mechanism
        self.sol, self.y, self.nq, self.nv, self.scales = sol, y, mech.nq, mech.nv, mech.coordinate_scales
        self.manifold, self.angles = mech.manifold, _revolute(mech)
        self.speeds = np.abs(sol.v).max(axis=0) + INPUT_DIGITS
        self.basis = np.zeros((self.nv, 0))
        if symmetries:
            w = np.column_stack([symmetry.direction(y[: self.nq]) for symmetry in symmetries])
            self.basis = np.linalg.qr(w / self.scales[:, None])[0]

    def __call__(self, times: Array) -> Array:
        """Return the distances at several times, (n,)."""
        found, nq = self.sol(times), self.nq
        moved = np.array([self.manifold.difference(self.y[:nq], q) for q in found.q])
        moved[:, self.angles] -= TWO_PI * np.round(moved[:, self.angles] / TWO_PI)
        moved /= self.scales
        moved -= moved @ self.basis @ self.basis.T
        faster = (found.v - self.y[nq : nq + self.nv]) / self.speeds
        return np.linalg.norm(np.hstack([moved, faster]), axis=1)
