"""Initial guesses of periodic motions from runs: period, shifts of joints, advances along symmetries."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ...errors import InputError, is_count
from ...mechanism import Mechanism
from ...mechanism.equations.invariance import MotionPoint, is_invariant, shift_units, symmetries_of
from ...mechanism.equations.symmetry import Symmetry
from ...solution.solution import Solution
from ...system import Array
from .period import is_autonomous, period_of_functions
from .returns import points_of
from .shooting.exchange import Exchange
from .shooting.flow import Flow
from .shooting.shooting_equations import Cycle, Guess

MAX_EVENTS = 9  # number of events at the start of a run among which the longest interval is selected


def guess_of(
    flow: Flow,
    y: Array,
    T: float | None,
    t: float,
    section: str | None,
    names: Sequence[str] | None,
    segments: int | None,
    joints: Mapping[str, str] | None = None,
) -> tuple[Cycle, Guess]:
    """Return the definition of a motion and its initial guess; symmetries are detected unless they are named.

    Raises:
        InputError: without an estimate of the period, or for wrong values.
        UnknownNameError: for an unknown symmetry.
    """
    mech = flow.mechanism
    exchange, system = Exchange(mech, joints), mech.system()
    k = number_of_segments(segments, section)
    Symmetry.named(system, names or ())  # rejects unknown names before a run
    autonomous = is_autonomous(mech, t, y)
    if section:
        y, T = _on_section(flow, t, y, T or mech.duration, section)
    elif mech.resets and autonomous:
        y, T = _between_events(flow, t, y, T)
    elif not autonomous:
        T = T or period_of_functions(mech)
    if T is None:
        raise InputError("the equations do not depend on time: give an estimate of the period, T, or a section")
    runs = _runs(flow, t, y, T, k, section)
    points = points_of(runs[-1])
    found = Symmetry.named(system, symmetries_of(mech, points) if names is None else names)
    cycle = Cycle(t, k, section, not autonomous and not section, autonomous, found, exchange)
    advances = _advances(cycle, mech, y[: mech.nq], points[-1])
    return cycle, Guess([y, *(run.y[-1] for run in runs[:-1])], T, *advances)


def _runs(flow: Flow, t: float, y: Array, T: float, k: int, section: str | None) -> list[Solution]:
    """Return the runs over the k segments of a period."""
    out = list[Solution]()
    for i in range(k):
        out.append(flow.run(t + i * T / k, y, T / k, section if i == k - 1 else None))
        y = out[-1].y[-1]
    return out


def number_of_segments(segments: int | None, section: str | None) -> int:
    """Return the number of segments of a period.

    Raises:
        InputError: for an invalid number.
    """
    if segments is not None and not is_count(segments):
        raise InputError(f"segments must be a positive whole number, got {segments!r:.60}")
    if section and segments == 1:
        raise InputError("a motion with a section has at least 2 segments: it is not monitored in the first one")
    return segments or (2 if section else 1)


def _advances(cycle: Cycle, mech: Mechanism, q: Array, end: MotionPoint) -> tuple[Array, Array]:
    """Return displacements (m,) along symmetries from an end back to q, and shifts (nv,) of joints."""
    dq, symmetries = mech.manifold.difference(q, cycle.exchange.apply(end.y[: mech.nq])), cycle.symmetries
    units = shift_units(mech)
    w = np.column_stack([*(symmetry.direction(q) for symmetry in symmetries), np.zeros((mech.nv, 0))])
    units[np.abs(w).max(axis=1, initial=0.0) > 0] = 0.0
    shifts = units * np.round(np.divide(dq, units, out=np.zeros(mech.nv), where=units > 0))
    if shifts.any() and not is_invariant(mech, end, shifts, 0.0 if cycle.autonomous else end.t - cycle.t):
        shifts[:] = 0.0
    return -np.linalg.lstsq(w, dq - shifts, rcond=None)[0] if symmetries else np.zeros(0), shifts


def _on_section(flow: Flow, t: float, y: Array, longest: float, section: str) -> tuple[Array, float]:
    """Return the first point of a motion on the section, and the time until the next crossing."""
    first = flow.run(t, y, longest, section)
    start = first.y[0] if first.t[-1] == first.t[0] else first.y[-1]
    second = flow.run(t, start, longest, section)
    return start, float(second.t[-1] - second.t[0])


def _between_events(flow: Flow, t: float, y: Array, T: float | None) -> tuple[Array, float]:
    """Return a point half-way between two events at which the state jumps, and the time from one to the next, or T.

    A segment must not end at an event, which would be missed or processed twice.

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
