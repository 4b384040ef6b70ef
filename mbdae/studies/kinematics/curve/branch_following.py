"""Curves along the branches that intersect at branch points."""

from typing import NamedTuple

import numpy as np

from ....errors import StepError
from ....system import Array
from ....tolerances import SAME_POSE
from .curve_sampling import Events, events
from .curve_tracing import follow
from .pose_curve import MIN_COSINE, BranchPoint, CurvePoint, PoseCurve

MAX_BRANCHES = 32
BRANCH_STEP = 0.02  # length of the step from a branch point onto a branch, in rad or characteristic lengths


class TracedCurve(NamedTuple):
    """A curve with its events, and the branch points at its start and end, if any."""

    curve: PoseCurve
    events: Events
    start: BranchPoint | None = None
    end: BranchPoint | None = None


def other_branches(first: TracedCurve, low: float, high: float) -> list[TracedCurve]:
    """Return curves along all unused tangents at branch points, within a range of the input.

    The search starts from one curve. Each curve ends where it reaches an earlier one.
    """
    search = _BranchSearch(first.curve)
    search.trim(first.curve, first.events)
    out: list[TracedCurve] = []
    k = 0
    while k < len(search.points) and len(out) < MAX_BRANCHES:
        out += search.follow(k, low, high)
        k += 1
    return out


class _BranchSearch:
    """Branch points found so far, and the directions +1, -1, +2, -2 that are used by curves."""

    def __init__(self, first: PoseCurve) -> None:
        self.first, self.start = first, first.nodes[0]
        self.points: list[BranchPoint] = []
        self.used_directions: list[set[int]] = []

    def follow(self, k: int, low: float, high: float) -> list[TracedCurve]:
        """Return the curves along the unused tangents at branch point k."""
        out = []
        point = self.points[k]
        for i, sign in ((i, s) for i in range(len(point.directions)) for s in (1, -1)):
            if sign * (i + 1) in self.used_directions[k]:
                continue
            self.used_directions[k].add(sign * (i + 1))
            curve = branch_off(self.first, point, sign * point.directions[i])
            if curve is not None and low <= curve.nodes[0].u <= high:
                follow(curve, low, high)
                found, end = self.trim(curve, events(curve))
                out.append(TracedCurve(curve, found, point, end))
        return out

    def trim(self, curve: PoseCurve, found: Events) -> tuple[Events, BranchPoint | None]:
        """Mark the directions that a curve uses; truncate it where it reaches an earlier curve."""
        for i in range(len(curve.nodes) - 1):
            start = self._start_in_step(curve, i)
            if start is not None:
                return _truncated(curve, found, i, [start]), None
            if i in found.branch_points:
                point, known = self._register(curve, i, found.branch_points[i])
                if known:
                    return _truncated(curve, found, i, []), point
        return found, None

    def _start_in_step(self, curve: PoseCurve, i: int) -> CurvePoint | None:
        """Return the start of the first curve if another curve passes through it after node i."""
        if curve is self.first:
            return None
        poses = (self.start, self.start._replace(tau=-self.start.tau))
        found = (curve.point_at_pose(i, pose) for pose in poses)
        return next((x for x in found if x is not None and abs(x.u - self.start.u) < SAME_POSE * curve.unit), None)

    def _register(self, curve: PoseCurve, i: int, point: BranchPoint) -> tuple[BranchPoint, bool]:
        """Mark both directions of a curve at a branch point; return whether an earlier curve used this direction."""
        k = next((k for k, other in enumerate(self.points) if is_same_point(curve, point, other)), len(self.points))
        if k == len(self.points):
            self.points.append(point)
            self.used_directions.append(set())
        along = self.points[k].directions @ curve.nodes[i].tau
        j = int(np.abs(along).argmax())
        known = (-1 if along[j] > 0 else 1) * (j + 1) in self.used_directions[k]
        self.used_directions[k] |= {j + 1, -j - 1}
        return self.points[k], known


def _truncated(curve: PoseCurve, found: Events, i: int, last: list[CurvePoint]) -> Events:
    """Truncate a curve after node i, and return its remaining events."""
    curve.nodes[i + 1 :] = last
    curve.ended = "branch"
    branch_points = {k: b for k, b in found.branch_points.items() if k < i}
    return found._replace(dead_points=[d for d in found.dead_points if d.node < i], branch_points=branch_points)


def branch_off(curve: PoseCurve, point: BranchPoint, direction: Array) -> PoseCurve | None:
    """Return a curve from a branch point along a tangent (nv,); None if no closed configuration is found."""
    other, step = PoseCurve(curve.system, curve.angular), BRANCH_STEP
    other.r = curve.r
    for _ in range(6):
        q = curve.integrate(point.q, step * direction)
        try:
            first = other.set_start(q, point.u + step * float(_input_row(curve, point) @ direction), direction)
        except StepError:
            first = None
        if first is not None and abs(first.tau @ direction) > MIN_COSINE:
            dx = curve.difference(point.q, first.q)
            if dx @ direction > 0.5 * step and np.linalg.norm(dx) < 2 * step:
                return other
        step /= 2
    return None


def _input_row(curve: PoseCurve, point: BranchPoint) -> Array:
    return curve.closures(point.q, point.u)[1][-1]


def is_same_point(curve: PoseCurve, a: BranchPoint, b: BranchPoint) -> bool:
    """Return whether two branch points are the same pose at the same input."""
    tolerance = 100 * SAME_POSE
    return abs(a.u - b.u) < tolerance * curve.unit and bool(
        np.abs(curve.wrapped_difference(a.q, b.q)).max() < tolerance
    )
