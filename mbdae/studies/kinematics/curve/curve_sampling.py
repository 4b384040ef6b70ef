"""Points of a curve at equidistant inputs between dead points."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ....errors import StepError
from ....tolerances import COARSE, COINCIDENT, INTERPOLATION, ROUNDING, SAME_STATE, SOLUTION_ROUNDING, ZERO_SPEED
from .pose_curve import BranchPoint, CurvePoint, PoseCurve

SMALL, TANGENCY = 0.5, 1.5  # minima of |sigma| over its maximum, over its change: double roots below
AT_BRANCH_POINT = INTERPOLATION  # negligible distance of the input from a branch point


class CurveLocation(NamedTuple):
    """A point of a curve: the node before it, its arclength from there, and its data."""

    node: int
    ds: float
    point: CurvePoint


class Events(NamedTuple):
    """Special points of a curve: dead points of the input joint, and branch points by the node before them."""

    dead_points: list[CurveLocation]
    branch_points: dict[int, BranchPoint]
    hidden: list[float]  # inputs at rank losses that are not simple branch points


def events(curve: PoseCurve) -> Events:
    """Locate the dead points and branch points of a curve."""
    dead: list[CurveLocation] = []
    branches: dict[int, BranchPoint] = {}
    hidden = _tangencies(curve)
    nodes = curve.nodes
    speed_tolerance = ZERO_SPEED * curve.unit
    at_rest = _at_rest(curve)
    if abs(nodes[0].speed) < speed_tolerance and not at_rest:
        dead.append(CurveLocation(0, 0.0, nodes[0]))
    for i, (a, b) in enumerate(pairwise(nodes)):
        if a.sigma * b.sigma < 0:
            found = curve.branch_points.get(i)
            if found:
                branches[i] = found
            else:
                hidden.append(curve.at(i, (b.s - a.s) * a.sigma / (a.sigma - b.sigma), predictor_only=True).u)
        at_start = (b is nodes[-1] and curve.ended == "closed" and abs(b.speed) < speed_tolerance) or abs(
            a.speed
        ) < speed_tolerance
        if a.speed * b.speed < 0 and i not in branches and not (at_start or at_rest):
            ds = curve.root(i, lambda p: p.speed)
            dead.append(CurveLocation(i, ds, curve.at(i, ds)))
    return Events(dead, branches, hidden)


def _at_rest(curve: PoseCurve) -> bool:
    """Return whether the drive is at rest on the whole curve, as the crank of a folded rhombus."""
    return all(abs(p.speed) < SOLUTION_ROUNDING * curve.unit for p in curve.nodes)


def _tangencies(curve: PoseCurve) -> list[float]:
    """Return inputs at double roots of sigma, where more than two branches intersect."""
    out = []
    size = max(abs(p.sigma) for p in curve.nodes)
    for i, (a, b, c) in enumerate(zip(curve.nodes, curve.nodes[1:], curve.nodes[2:], strict=False)):
        if not (a.sigma * b.sigma > 0 < b.sigma * c.sigma and abs(b.sigma) < SMALL * size):
            continue
        if abs(b.sigma) > min(abs(a.sigma), abs(c.sigma)):
            continue
        before, after = (abs(x.sigma - b.sigma) / abs(x.s - b.s) for x in (a, c))
        if abs(b.sigma) < TANGENCY * max(before * (b.s - a.s), after * (c.s - b.s)):
            step = i if abs(a.sigma) < abs(c.sigma) else i + 1
            out.append(_minimum(curve, step, size))
    return [u for u in out if np.isfinite(u)]


def _minimum(curve: PoseCurve, i: int, size: float) -> float:
    """Return the input at the minimum of |sigma| after node i; nan if that is not zero."""
    h = curve.nodes[i + 1].s - curve.nodes[i].s

    def value(ds: float) -> float:
        try:
            return abs(curve.at(i, ds).sigma)
        except (StepError, ValueError, np.linalg.LinAlgError):
            return 0.0

    found = minimize_scalar(value, bounds=(0.0, h), method="bounded", options={"xatol": SAME_STATE * h})
    return curve.at(i, float(found.x), predictor_only=True).u if found.fun < COARSE * size else np.nan


def sample(curve: PoseCurve, found: Events, n: int) -> list[CurvePoint]:
    """Return about n points of a curve: its ends, dead points, and equidistant inputs between these.

    If the drive is at rest, arclengths are equidistant.
    """
    nodes = curve.nodes
    if _at_rest(curve):
        values = np.linspace(nodes[0].s, nodes[-1].s, n)[1:-1]
        steps = np.searchsorted([p.s for p in nodes], values, side="right") - 1
        interior = (curve.at(int(i), float(s - nodes[i].s)) for i, s in zip(steps, values, strict=True))
        return [nodes[0], *interior, nodes[-1]]
    inside = [d for d in found.dead_points if d.point is not nodes[0]]
    last = CurveLocation(len(nodes) - 2, nodes[-1].s - nodes[-2].s, nodes[-1])
    ends = [CurveLocation(0, 0.0, nodes[0]), *inside, last]
    total = sum(abs(b.point.u - a.point.u) for a, b in pairwise(ends))
    out: list[CurvePoint] = []
    for a, b in pairwise(ends):
        m = max(1, round((n - 1) * abs(b.point.u - a.point.u) / total)) if total else 1
        values = np.linspace(a.point.u, b.point.u, m + 1)[1:-1]
        sign = np.sign(b.point.u - a.point.u)
        between = sign * np.array([a.point.u, *(p.u for p in nodes[a.node + 1 : b.node + 1])])
        steps = a.node + np.searchsorted(between, sign * values, side="right") - 1
        out.append(a.point)
        out += [_sampled(curve, found, a, b, int(i), float(u)) for i, u in zip(steps, values, strict=True)]
    return [*out, ends[-1].point]


def _sampled(curve: PoseCurve, found: Events, start: CurveLocation, end: CurveLocation, i: int, u: float) -> CurvePoint:
    """Return the point after node i with the input u, between two points of the curve."""
    a, b = curve.nodes[i : i + 2]
    crossing = found.branch_points.get(i)
    if crossing is not None and abs(crossing.u - u) < AT_BRANCH_POINT * curve.unit:
        return branch_point_on_curve(curve, crossing, a)
    low = start.ds if start.node == i else 0.0
    high = end.ds if end.node == i else b.s - a.s
    if low or high < b.s - a.s:  # next to a dead point
        ds = brentq(lambda x: curve.at(i, x).u - u, low, high, xtol=COINCIDENT)
    else:
        ds = _inverse(a, b, u, SOLUTION_ROUNDING * curve.unit)
    for offset in (0.0, AT_BRANCH_POINT, -AT_BRANCH_POINT):  # next to a singular pose, which has no tangent
        estimate = curve.at(i, min(max(ds + offset * (b.s - a.s), low), high), predictor_only=True)
        if (point := curve.at_input(estimate, estimate.u if offset else u)) is not None:
            return point._replace(s=curve.arclength(i, point))
    return _by_arclength(curve, i, low, high, u)


def _by_arclength(curve: PoseCurve, i: int, low: float, high: float, u: float) -> CurvePoint:
    try:
        return curve.at(i, brentq(lambda x: curve.at(i, x).u - u, low, high, xtol=ROUNDING))
    except ValueError:
        raise StepError("newton", f"the loops cannot be closed at {u:.9g}") from None


def branch_point_on_curve(
    curve: PoseCurve, point: BranchPoint, neighbour: CurvePoint, *, before: bool = False
) -> CurvePoint:
    """Return a branch point as a point on the branch of a neighbour, after or before it.

    Its curvature kappa is nan: it depends on third derivatives of the closures.
    """
    along = point.directions @ neighbour.tau
    k = int(np.abs(along).argmax())
    tau = point.directions[k] * np.sign(along[k])
    e = curve.closures(point.q, point.u)[1][-1]
    distance = float(np.linalg.norm(curve.difference(neighbour.q, point.q)))
    s, unknown = neighbour.s + (-distance if before else distance), np.full_like(tau, np.nan)
    return neighbour._replace(
        s=s, q=point.q, u=point.u, tau=tau, kappa=unknown, speed=float(e @ tau), input_curvature=np.nan, sigma=0.0
    )


def _inverse(a: CurvePoint, b: CurvePoint, u: float, tolerance: float) -> float:
    """Return the arclength after a at which the cubic interpolant of the input between a and b is u."""
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
        if abs(value) < tolerance:
            break
    return x * h
