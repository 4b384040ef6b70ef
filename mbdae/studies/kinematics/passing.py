"""Stops, ropes and contacts that a prescribed motion passes, and clutches that it turns back: they do not act on it."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PPoly

from ...errors import StepError
from ...mechanism import Mechanism
from ...mechanism.hybrid.mode_point import AllRows
from ...mechanism.hybrid.switch import Margins, Switch
from ...system import Array
from ...tolerances import HALF_DIGITS, VISIBLE
from .pose_curve import PoseCurve

NEARBY = 1e-2  # of a cubic's depth: that of the curve itself
NEWTON = 5  # iterations from a root of the cubic
SHOWN = 4  # passages of one stop that a text names


class Passed(NamedTuple):
    """Stop, closure or clutch that a prescribed motion passes.

    Attributes:
        name: of the stop, closure or clutch.
        first: where it begins, in the abscissa of the motion.
        last: where it ends.
        most: how far at most, in the unit of its row.
        unit: ``"rad"`` or ``"m"``.
    """

    name: str
    first: float
    last: float
    most: float
    unit: str


def passages(mech: Mechanism, x: Array, q: Array, rates: Array, over: Array) -> tuple[Passed, ...]:
    """Return where a motion passes what presses on one side, and turns one-way clutches back.

    Gaps are cubics between the points, of which the roots count.

    Args:
        mech: the mechanism.
        x: time, rising, (n,).
        q: configurations, (n, nq).
        rates: dq/dx, (n, nv).
        over: the abscissa at x, (n,).
    """
    return _passages(mech, x, q, rates, lambda _, at: float(np.interp(at, x, over)))


def passed_by(mech: Mechanism, curve: PoseCurve) -> tuple[Passed, ...]:
    """Return the same of a curve of poses over its input, whose roots are found on the curve itself."""
    nodes, all_rows = curve.nodes, AllRows(mech.system())
    x = np.array([p.s for p in nodes])

    def gap(switch: Switch, s: float, cubic: float) -> float:
        i = int(np.clip(np.searchsorted(x, s, side="right") - 1, 0, len(x) - 2))
        with suppress(StepError):
            here = curve.at(i, s - x[i])
            found = switch.margins(_judged(all_rows, [s], [here.q], [here.tau * curve.columns]))
            if found and abs(found[0][0] + cubic) < NEARBY * cubic:  # not a margin that counts from an earlier pose
                return float(-found[0][0])
        return cubic

    def to(switch: Switch, s: float) -> float:
        if s in (x[0], x[-1]):
            return nodes[0 if s == x[0] else -1].u
        i = int(np.clip(np.searchsorted(x, s, side="right") - 1, 0, len(x) - 2))
        here = curve.at(i, s - x[i], roughly=True)
        with suppress(StepError):  # beside a branch point the cubic is what is known
            for _ in range(NEWTON):
                here = curve.at(i, s - x[i])
                motion = _judged(all_rows, [s], [here.q], [here.tau * curve.columns])
                value, rate = switch.margins(motion) or (np.zeros(1), None)
                if rate is None or not abs(rate[0]) > HALF_DIGITS * mech.row_scales[switch.row]:
                    break
                s = float(np.clip(s - value[0] / rate[0], x[i], x[i + 1]))
        return here.u

    return _passages(mech, x, np.array([p.q for p in nodes]), np.array([p.tau * curve.columns for p in nodes]), to, gap)


def _passages(
    mech: Mechanism,
    x: Array,
    q: Array,
    rates: Array,
    to: Callable[[Switch, float], float],
    gap: Callable[[Switch, float, float], float] = lambda switch, s, cubic: cubic,
) -> tuple[Passed, ...]:
    if not mech.switches:
        return ()
    motion, out = _judged(AllRows(mech.system()), x, q, rates), []
    for switch in mech.switches:
        if not (found := switch.margins(motion)):
            continue
        value, rate = found
        unit = float(mech.row_scales[switch.row])
        for first, last, most, at in below(x, value / unit, None if rate is None else rate / unit):
            most = gap(switch, at, most * unit)
            out.append(
                Passed(switch.name, to(switch, first), to(switch, last), most, str(mech.row_units[switch.row]))
            )
    return tuple(out)


def _judged(all_rows: AllRows, x: Any, q: Any, rates: Any) -> Margins:
    g, G, _ = zip(*(all_rows(0.0, p) for p in q), strict=True)
    return Margins(np.asarray(x), np.asarray(q), np.array(g), np.einsum("nij,nj->ni", np.array(G), np.asarray(rates)))


def below(x: Array, value: Array, rate: Array | None) -> list[tuple[float, float, float, float]]:
    """Return where a function is below zero: from, to, by how much at most, and where.

    Args:
        x: rising, (n,).
        value: there, (n,).
        rate: its derivative, (n,); when left out the function is one of straight lines.
    """
    if len(x) < 2:
        return [(float(x[0]), float(x[0]), float(-value[0]), float(x[0]))] if value.min(initial=0.0) < -VISIBLE else []
    linear = rate is None
    curve: PPoly = PPoly(np.array([np.diff(value) / np.diff(x), value[:-1]]), x) if linear else CubicHermiteSpline(
        x, value, rate
    )
    roots = curve.roots(discontinuity=False, extrapolate=False)
    lowest = np.empty(0) if linear else curve.derivative().roots(discontinuity=False, extrapolate=False)
    ends = np.unique([x[0], *roots[np.isfinite(roots)], x[-1]])
    at = np.concatenate([x, lowest[np.isfinite(lowest)]])
    depth = -curve(at)
    out: list[tuple[float, float, float, float]] = []
    for a, b in pairwise(ends):
        inside = np.flatnonzero((at >= a) & (at <= b))
        deepest = inside[depth[inside].argmax()] if len(inside) else None
        if deepest is not None and depth[deepest] > VISIBLE and curve((a + b) / 2) < 0:
            out.append((float(a), float(b), float(depth[deepest]), float(at[deepest])))
    return out


def lines_of(found: Sequence[Passed], over: str, unit: str) -> list[str]:
    """Lines that name what is passed."""
    out = []
    for name in dict.fromkeys(p.name for p in found):
        of_it = [p for p in found if p.name == name]
        where = ", ".join(f"{_shown(p.first)} to {_shown(p.last)}" for p in of_it[:SHOWN])
        more = f" and {len(of_it) - SHOWN} times more" if len(of_it) > SHOWN else ""
        most = max(p.most for p in of_it)
        out.append(f"  passes {name!r}, which does not act, by up to {most:.4g} {of_it[0].unit}: "
                   f"{over} = {where}{more} {unit}")  # fmt: skip
    return out


def _shown(x: float) -> str:
    return f"{round(x, 9) + 0.0:.6g}"
