"""Curves along the branches that cross at a branch point."""

import numpy as np

from ...errors import StepError
from ...system import Array
from .branch_points import BranchPoint
from .pose_curve import NEAR, TURN, PoseCurve

STEP = 0.02  # from a branch point onto a branch


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
        if first is not None and abs(first.tau @ direction) > TURN:
            away = curve.difference(point.q, first.q)
            if away @ direction > 0.5 * step and np.linalg.norm(away) < 2 * step:
                return other
        step /= 2
    return None


def _input_row(curve: PoseCurve, point: BranchPoint) -> Array:
    return curve.closures(point.q, point.u)[1][-1]


def is_same_point(curve: PoseCurve, a: BranchPoint, b: BranchPoint) -> bool:
    """Whether two branch points are one pose at one value of the input."""
    return abs(a.u - b.u) < 100 * NEAR * curve.unit and bool(np.abs(curve.wrapped(a.q, b.q)).max() < 100 * NEAR)
