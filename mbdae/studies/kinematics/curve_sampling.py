"""Points of a curve at even values of the input, from dead point to dead point."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ...errors import StepError
from ...tolerances import COARSE, COINCIDENT, INTERPOLATION, ROUNDING, SAME_STATE, SOLUTION_ROUNDING, STILL
from .branch_points import BranchPoint
from .pose_curve import CurvePoint, PoseCurve

SMALL, TOUCH = 0.5, 1.5  # of the largest sigma, and of its change over a step: smaller ones are searched for zeros
CLOSE = INTERPOLATION  # of the input: a value so near a branch point is the branch point


class OnCurve(NamedTuple):
    """A point of a curve: behind which node it lies, how far, and what it is."""

    node: int
    sigma: float
    point: CurvePoint


class Events(NamedTuple):
    """Special points of a curve: dead points of the drive, and branch points by the node before them."""

    dead: list[OnCurve]
    branches: dict[int, BranchPoint]
    hidden: list[float]  # inputs where G loses rank in another way


def events(curve: PoseCurve) -> Events:
    """Locate the dead points and branch points of a curve."""
    dead: list[OnCurve] = []
    branches: dict[int, BranchPoint] = {}
    hidden = _touching(curve)
    nodes = curve.nodes
    still = STILL * curve.unit
    if abs(nodes[0].speed) < still:
        dead.append(OnCurve(0, 0.0, nodes[0]))
    for i, (a, b) in enumerate(pairwise(nodes)):
        if a.sigma * b.sigma < 0:
            found = curve.crossings.get(i)
            if found:
                branches[i] = found
            else:
                hidden.append(curve.at(i, (b.s - a.s) * a.sigma / (a.sigma - b.sigma), roughly=True).u)
        at_start = (b is nodes[-1] and curve.ended == "closed" and abs(b.speed) < still) or abs(a.speed) < still
        if a.speed * b.speed < 0 and i not in branches and not at_start:
            sigma = curve.zero(i, lambda p: p.speed)
            dead.append(OnCurve(i, sigma, curve.at(i, sigma)))
    return Events(dead, branches, hidden)


def _touching(curve: PoseCurve) -> list[float]:
    """Inputs where sigma comes to zero without a change of its sign: several branches cross at once."""
    out = []
    size = max(abs(p.sigma) for p in curve.nodes)
    for i, (a, b, c) in enumerate(zip(curve.nodes, curve.nodes[1:], curve.nodes[2:], strict=False)):
        if not (a.sigma * b.sigma > 0 < b.sigma * c.sigma and abs(b.sigma) < SMALL * size):
            continue
        if abs(b.sigma) > min(abs(a.sigma), abs(c.sigma)):
            continue
        before, behind = (abs(x.sigma - b.sigma) / abs(x.s - b.s) for x in (a, c))
        if abs(b.sigma) < TOUCH * max(before * (b.s - a.s), behind * (c.s - b.s)):
            side = i if abs(a.sigma) < abs(c.sigma) else i + 1
            out.append(_lowest(curve, side, size))
    return [u for u in out if np.isfinite(u)]


def _lowest(curve: PoseCurve, i: int, size: float) -> float:
    """The input where |sigma| is least behind node i; nan where it is not zero."""
    h = curve.nodes[i + 1].s - curve.nodes[i].s

    def value(sigma: float) -> float:
        try:
            return abs(curve.at(i, sigma).sigma)
        except (StepError, ValueError, np.linalg.LinAlgError):
            return 0.0

    found = minimize_scalar(value, bounds=(0.0, h), method="bounded", options={"xatol": SAME_STATE * h})
    return curve.at(i, float(found.x), roughly=True).u if found.fun < COARSE * size else np.nan


def sample(curve: PoseCurve, found: Events, n: int) -> list[CurvePoint]:
    """About n points of a curve: even in the input between the start, dead points and the end, which are among them."""
    nodes = curve.nodes
    inside = [d for d in found.dead if d.point is not nodes[0]]
    ends = [OnCurve(0, 0.0, nodes[0]), *inside, OnCurve(len(nodes) - 2, nodes[-1].s - nodes[-2].s, nodes[-1])]
    travel = sum(abs(b.point.u - a.point.u) for a, b in pairwise(ends))
    out: list[CurvePoint] = []
    for a, b in pairwise(ends):
        m = max(1, round((n - 1) * abs(b.point.u - a.point.u) / travel)) if travel else 1
        values = np.linspace(a.point.u, b.point.u, m + 1)[1:-1]
        sign = np.sign(b.point.u - a.point.u)
        between = sign * np.array([a.point.u, *(p.u for p in nodes[a.node + 1 : b.node + 1])])
        steps = a.node + np.searchsorted(between, sign * values, side="right") - 1
        out.append(a.point)
        out += [_sampled(curve, found, a, b, int(i), float(u)) for i, u in zip(steps, values, strict=True)]
    return [*out, ends[-1].point]


def _sampled(curve: PoseCurve, found: Events, start: OnCurve, end: OnCurve, i: int, u: float) -> CurvePoint:
    """The point behind node i with the input u, between two places."""
    a, b = curve.nodes[i : i + 2]
    crossing = found.branches.get(i)
    if crossing is not None and abs(crossing.u - u) < CLOSE * curve.unit:
        return at_crossing(curve, crossing, a)
    low = start.sigma if start.node == i else 0.0
    high = end.sigma if end.node == i else b.s - a.s
    if low or high < b.s - a.s:  # beside a dead point
        sigma = brentq(lambda x: curve.at(i, x).u - u, low, high, xtol=COINCIDENT)
    else:
        sigma = _inverse(a, b, u, SOLUTION_ROUNDING * curve.unit)
    for aside in (0.0, CLOSE, -CLOSE):  # a singular pose has no tangent: one beside it
        near = curve.at(i, min(max(sigma + aside * (b.s - a.s), low), high), roughly=True)
        if (found_there := curve.at_input(near, near.u if aside else u)) is not None:
            return found_there
    return _by_arclength(curve, i, low, high, u)


def _by_arclength(curve: PoseCurve, i: int, low: float, high: float, u: float) -> CurvePoint:
    try:
        return curve.at(i, brentq(lambda x: curve.at(i, x).u - u, low, high, xtol=ROUNDING))
    except ValueError:
        raise StepError("newton", f"the loops cannot be closed at {u:.9g}") from None


def at_crossing(curve: PoseCurve, crossing: BranchPoint, beside: CurvePoint, *, behind: bool = False) -> CurvePoint:
    """A branch point on the branch of a node beside it; kappa, which takes third derivatives, is not known."""
    along = crossing.directions @ beside.tau
    k = int(np.abs(along).argmax())
    tau = crossing.directions[k] * np.sign(along[k])
    e = curve.closures(crossing.q, crossing.u)[1][-1]
    away = float(np.linalg.norm(curve.difference(beside.q, crossing.q)))
    s, unknown = beside.s + (-away if behind else away), np.full_like(tau, np.nan)
    return beside._replace(
        s=s, q=crossing.q, u=crossing.u, tau=tau, kappa=unknown, speed=float(e @ tau), bend=np.nan, sigma=0.0
    )


def _inverse(a: CurvePoint, b: CurvePoint, u: float, near: float) -> float:
    """The arclength behind a where the input, a cubic between a and b, has the value u."""
    h, low, high = b.s - a.s, 0.0, 1.0
    d, x = b.u - a.u, (u - a.u) / (b.u - a.u)
    m0, m1 = h * a.speed, h * b.speed
    c2, c3 = 3 * d - 2 * m0 - m1, m0 + m1 - 2 * d
    for _ in range(8):
        value = a.u + x * (m0 + x * (c2 + x * c3)) - u
        low, high = (x, high) if value * d < 0 else (low, x)
        x -= value / (m0 + x * (2 * c2 + 3 * x * c3))
        if not low <= x <= high:
            x = (low + high) / 2
        if abs(value) < near:
            break
    return x * h
