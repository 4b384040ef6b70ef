"""Curves along the branches that cross at a branch point."""

from typing import NamedTuple

import numpy as np

from ...errors import StepError
from ...system import Array
from ...tolerances import SAME_POSE
from .branch_points import BranchPoint
from .curve_sampling import Events, events
from .pose_curve import MIN_COSINE, CurvePoint, PoseCurve

MOST_BRANCHES = 32
STEP = 0.02  # from a branch point onto a branch


class Followed(NamedTuple):
    """A curve with its events, and the branch points where it begins and ends."""

    curve: PoseCurve
    events: Events
    begins: BranchPoint | None = None
    ends: BranchPoint | None = None


def other_branches(first: Followed, low: float, high: float) -> list[Followed]:
    """Return curves along all tangents at branch points that no curve has passed, from one and within a range.

    Each ends where it comes upon another.
    """
    search = _BranchSearch(first.curve)
    search.trim(first.curve, first.events)
    out: list[Followed] = []
    k = 0
    while k < len(search.met) and len(out) < MOST_BRANCHES:
        out += search.follow(k, low, high)
        k += 1
    return out


class _BranchSearch:
    """Branch points met so far, and the directions +1, -1, +2, -2 that curves take from each."""

    def __init__(self, first: PoseCurve) -> None:
        self.first, self.start = first, first.nodes[0]
        self.met: list[BranchPoint] = []
        self.used: list[set[int]] = []

    def follow(self, k: int, low: float, high: float) -> list[Followed]:
        """Return the curves along the unused tangents at branch point k."""
        out = []
        point = self.met[k]
        for way, sign in ((w, s) for w in range(len(point.directions)) for s in (1, -1)):
            if sign * (way + 1) in self.used[k]:
                continue
            self.used[k].add(sign * (way + 1))
            curve = branch_off(self.first, point, sign * point.directions[way])
            if curve is not None and low <= curve.nodes[0].u <= high:
                curve.follow(low, high)
                found, ends = self.trim(curve, events(curve))
                out.append(Followed(curve, found, point, ends))
        return out

    def trim(self, curve: PoseCurve, found: Events) -> tuple[Events, BranchPoint | None]:
        """Mark the directions that a curve takes; cut it where it comes upon a curve found before."""
        for i in range(len(curve.nodes) - 1):
            again = self._at_start(curve, i)
            if again is not None:
                return _cut(curve, found, i, [again]), None
            if i in found.branches:
                point, known = self._pass(curve, i, found.branches[i])
                if known:
                    return _cut(curve, found, i, []), point
        return found, None

    def _at_start(self, curve: PoseCurve, i: int) -> CurvePoint | None:
        """Return the start of the first curve if another curve passes it behind node i."""
        if curve is self.first:
            return None
        poses = (self.start, self.start._replace(tau=-self.start.tau))
        found = (curve.passing(i, pose) for pose in poses)
        return next((x for x in found if x is not None and abs(x.u - self.start.u) < SAME_POSE * curve.unit), None)

    def _pass(self, curve: PoseCurve, i: int, point: BranchPoint) -> tuple[BranchPoint, bool]:
        """Mark both directions of a curve at a branch point; return whether a curve came from there before."""
        k = next((k for k, other in enumerate(self.met) if is_same_point(curve, point, other)), len(self.met))
        if k == len(self.met):
            self.met.append(point)
            self.used.append(set())
        along = self.met[k].directions @ curve.nodes[i].tau
        way = int(np.abs(along).argmax())
        known = (-1 if along[way] > 0 else 1) * (way + 1) in self.used[k]
        self.used[k] |= {way + 1, -way - 1}
        return self.met[k], known


def _cut(curve: PoseCurve, found: Events, i: int, last: list[CurvePoint]) -> Events:
    """End a curve behind node i; return its events before."""
    curve.nodes[i + 1 :] = last
    curve.ended = "branch"
    branches = {k: b for k, b in found.branches.items() if k < i}
    return found._replace(dead=[d for d in found.dead if d.node < i], branches=branches)


def branch_off(curve: PoseCurve, point: BranchPoint, direction: Array) -> PoseCurve | None:
    """A curve from a branch point along a tangent (nv,); None where no closed configuration is found there."""
    other, step = PoseCurve(curve.system, curve.angular), STEP
    other.r = curve.r
    for _ in range(6):
        q = curve.integrate(point.q, step * direction)
        try:
            first = other.begin(q, point.u + step * float(_input_row(curve, point) @ direction), direction)
        except StepError:
            first = None
        if first is not None and abs(first.tau @ direction) > MIN_COSINE:
            away = curve.difference(point.q, first.q)
            if away @ direction > 0.5 * step and np.linalg.norm(away) < 2 * step:
                return other
        step /= 2
    return None


def _input_row(curve: PoseCurve, point: BranchPoint) -> Array:
    return curve.closures(point.q, point.u)[1][-1]


def is_same_point(curve: PoseCurve, a: BranchPoint, b: BranchPoint) -> bool:
    """Whether two branch points are one pose at one value of the input."""
    near = 100 * SAME_POSE
    return abs(a.u - b.u) < near * curve.unit and bool(np.abs(curve.wrapped(a.q, b.q)).max() < near)
