"""Violations of unilateral constraints and one-way clutches by a prescribed motion, on which they exert no force."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PPoly

from ...errors import StepError
from ...mechanism import Mechanism
from ...mechanism.hybrid.mode_point import AllRows
from ...mechanism.hybrid.switch import SampledMotion, Switch
from ...system import Array
from ...tolerances import CLOSED, HALF_DIGITS, VISIBLE
from ...units import displayed, quantity, unit_name
from .curve.pose_curve import PoseCurve

CONSISTENT = 1e-2  # largest relative difference of the depths of the cubic and of the curve
NEWTON_STEPS = 5  # number of Newton steps from a root of the cubic
LISTED = 4  # number of intervals of one constraint in a text


class Violation(NamedTuple):
    """Interval in which a prescribed motion violates a stop, unilateral closure or clutch, or stays in contact.

    Attributes:
        name: name of the stop, closure or clutch.
        first: start of the interval, on the abscissa of the motion.
        last: end of the interval.
        most: largest violation, in the unit of the row; 0 in contact, where the force is not determined by the motion.
        unit: ``"rad"`` or ``"m"``.
    """

    name: str
    first: float
    last: float
    most: float
    unit: str


def unilateral_violations(mech: Mechanism, x: Array, q: Array, rates: Array, over: Array) -> tuple[Violation, ...]:
    """Return the intervals in which a motion violates unilateral constraints or reverses one-way clutches.

    Gaps are interpolated by cubics, reverse rotations of clutches linearly; intervals end at the roots.

    Args:
        mech: the mechanism.
        x: time, increasing, (n,).
        q: configurations, (n, nq).
        rates: dq/dx, (n, nv).
        over: the abscissa at x, (n,).
    """
    return _violations(mech, x, q, rates, lambda _, t: float(np.interp(t, x, over)))


def curve_violations(mech: Mechanism, curve: PoseCurve) -> tuple[Violation, ...]:
    """Return the violations of a curve of poses over its input, with roots located on the curve itself."""
    nodes, all_rows = curve.nodes, AllRows(mech.system())
    x = np.array([p.s for p in nodes])

    def gap(switch: Switch, s: float, cubic: float) -> float:
        i = int(np.clip(np.searchsorted(x, s, side="right") - 1, 0, len(x) - 2))
        with suppress(StepError):
            point = curve.at(i, s - x[i])
            found = switch.margins(_margins_data(all_rows, [s], [point.q], [point.tau * curve.scales]))
            if found and abs(found[0][0] + cubic) < CONSISTENT * cubic:  # not a margin relative to an earlier pose
                return float(-found[0][0])
        return cubic

    def abscissa(switch: Switch, s: float) -> float:
        if s in (x[0], x[-1]):
            return nodes[0 if s == x[0] else -1].u
        i = int(np.clip(np.searchsorted(x, s, side="right") - 1, 0, len(x) - 2))
        point = curve.at(i, s - x[i], predictor_only=True)
        with suppress(StepError):  # near a branch point use the cubic
            for _ in range(NEWTON_STEPS):
                point = curve.at(i, s - x[i])
                motion = _margins_data(all_rows, [s], [point.q], [point.tau * curve.scales])
                value, rate = switch.margins(motion) or (np.zeros(1), None)
                if rate is None or not abs(rate[0]) > HALF_DIGITS * mech.row_scales[switch.row]:
                    break
                s = float(np.clip(s - value[0] / rate[0], x[i], x[i + 1]))
        return point.u

    return _violations(
        mech, x, np.array([p.q for p in nodes]), np.array([p.tau * curve.scales for p in nodes]), abscissa, gap
    )


def _violations(
    mech: Mechanism,
    x: Array,
    q: Array,
    rates: Array,
    to_abscissa: Callable[[Switch, float], float],
    gap: Callable[[Switch, float, float], float] = lambda switch, s, cubic: cubic,
) -> tuple[Violation, ...]:
    if not mech.switches:
        return ()
    motion, out = _margins_data(AllRows(mech.system()), x, q, rates), []
    for switch in mech.switches:
        if not (found := switch.margins(motion)):
            continue
        value, rate = found
        unit = float(mech.row_scales[switch.row])
        intervals = negative_intervals(x, value / unit, None if rate is None else rate / unit)
        entries = [(first, last, gap(switch, lowest, most * unit)) for first, last, most, lowest in intervals]
        if rate is not None:
            entries += [(*ends, 0.0) for ends in contact_intervals(x, value / unit)]
        for first, last, most in sorted(entries):
            ends = to_abscissa(switch, first), to_abscissa(switch, last)
            out.append(Violation(switch.name, *ends, most, str(mech.row_units[switch.row])))
    return tuple(out)


def contact_intervals(x: Array, gap: Array) -> list[tuple[float, float]]:
    """Return the intervals in which a gap (n,), in rad or characteristic lengths, stays closed at the points x (n,)."""
    closed = np.concatenate([[False], np.abs(gap) <= CLOSED, [False]]).astype(int)
    starts, ends = np.flatnonzero(np.diff(closed) > 0), np.flatnonzero(np.diff(closed) < 0) - 1
    return [(float(x[a]), float(x[b])) for a, b in zip(starts, ends, strict=True) if b > a]


def _margins_data(all_rows: AllRows, x: Any, q: Any, rates: Any) -> SampledMotion:
    g, G, _ = zip(*(all_rows(0.0, p) for p in q), strict=True)
    g_rate = np.einsum("nij,nj->ni", np.array(G), np.asarray(rates))
    return SampledMotion(np.asarray(x), np.asarray(q), np.array(g), g_rate)


def negative_intervals(x: Array, value: Array, rate: Array | None) -> list[tuple[float, float, float, float]]:
    """Return intervals where a function is negative: start, end, depth, and position of the minimum.

    Args:
        x: abscissa, increasing, (n,).
        value: values of the function, (n,).
        rate: derivative of the function, (n,); when left out, the function is piecewise linear.
    """
    if len(x) < 2:
        return [(float(x[0]), float(x[0]), float(-value[0]), float(x[0]))] if value.min(initial=0.0) < -VISIBLE else []
    linear = rate is None
    curve: PPoly = (
        PPoly(np.array([np.diff(value) / np.diff(x), value[:-1]]), x) if linear else CubicHermiteSpline(x, value, rate)
    )
    roots = curve.roots(discontinuity=False, extrapolate=False)
    lowest = np.empty(0) if linear else curve.derivative().roots(discontinuity=False, extrapolate=False)
    ends = np.unique([x[0], *roots[np.isfinite(roots)], x[-1]])
    samples = np.concatenate([x, lowest[np.isfinite(lowest)]])
    depth = -curve(samples)
    out: list[tuple[float, float, float, float]] = []
    for a, b in pairwise(ends):
        inside = np.flatnonzero((samples >= a) & (samples <= b))
        deepest = inside[depth[inside].argmax()] if len(inside) else None
        if deepest is not None and depth[deepest] > VISIBLE and curve((a + b) / 2) < 0:
            out.append((float(a), float(b), float(depth[deepest]), float(samples[deepest])))
    return out


def violation_lines(found: Sequence[Violation], over: str, unit: str) -> list[str]:
    """Return a line for each constraint that is violated or in contact."""
    out = []
    for name, in_contact in dict.fromkeys((p.name, not p.most) for p in found):
        intervals = [p for p in found if (p.name, not p.most) == (name, in_contact)]
        values = ([displayed(x, unit)[0] for x in (p.first, p.last)] for p in intervals[:LISTED])
        where = ", ".join(f"{_shown(first)} to {_shown(last)}" for first, last in values)
        more = f" and {len(intervals) - LISTED} times more" if len(intervals) > LISTED else ""
        most = max(p.most for p in intervals)
        text = f"violates {name!r}, which does not act, by up to {quantity(most, intervals[0].unit, '.4g')}"
        text = f"is in contact with {name!r}, which exerts no force here" if in_contact else text
        out.append(f"  {text}: {over} = {where}{more} {unit_name(unit)}")
    return out


def _shown(x: float) -> str:
    return f"{round(x, 9) + 0.0:.6g}"
