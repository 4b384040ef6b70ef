"""Circuits: the curve through an assembly mode, and all poses on it with the same value of the input.

On a closed curve of regular poses the signs of du/ds at the crossings of one value add up to 0 for a prismatic input,
and to the number of revolutions for a revolute one. So each circuit has an even number of modes of a prismatic input. A
curve along which a prismatic input is unbounded in both directions is not a circuit, and has an odd number of modes.
Source: Chase, Mirth, J. Mech. Design 115 (1993); and the degree of a map of the circle.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import brentq

from ....errors import StepError
from ....system import Array
from ....tolerances import COINCIDENT, SAME_POSE, ZERO_SPEED
from .curve_tracing import follow
from .pose_curve import MAX_DISPLACEMENT, CurvePoint, PoseCurve

if TYPE_CHECKING:
    from ....mechanism.formulations.index2 import Index2System


class Circuit(NamedTuple):
    """A curve of poses.

    Attributes:
        crossings: poses with the input of the first pose, up to full turns: q (nq,), and whether the input increases.
        warning: reason why poses may be missing; empty for none.
    """

    crossings: list[tuple[Array, bool]]
    warning: str


def circuit(system: "Index2System", angular: Array, period: float, q: Array, u: float) -> Circuit:
    """Trace the circuit of a closed pose q (nq,) at the input u.

    Args:
        system: a workspace of `mbdae.studies.kinematics.driven_mechanism.driven_mechanism`.
        angular: mask of the coordinates that are angles, (nv,).
        period: period of the input, 2 pi for an angle, else 0.
        q: the pose.
        u: the input at the pose.
    """
    curve = PoseCurve(system, angular, period)
    try:
        first = curve.set_start(q, u)
    except (StepError, np.linalg.LinAlgError):
        return Circuit([(q, True)], "its first pose is singular")
    crossings = _crossings_of(curve, u)
    if curve.ended == "closed":
        revolutions = round((curve.nodes[-1].u - first.u) / period) if period else 0
        signs = sum(_rate_sign(p, curve) for p in crossings)
        message = f"the input crosses its value {len(crossings)} times, which is inconsistent"
        warning = "" if signs == revolutions else message
    else:
        backward = PoseCurve(system, angular, period)
        backward.set_start(q, u, -first.tau)
        reverse = _crossings_of(backward, u)
        crossings += [p._replace(tau=-p.tau, speed=-p.speed) for p in reverse[1:]]
        warning = "" if _is_unbounded(curve, backward) else "it was not traced back to its first pose"
    return Circuit([(p.q, p.speed > 0) for p in crossings], warning)


def _is_unbounded(forward: PoseCurve, backward: PoseCurve) -> bool:
    """Return whether a prismatic input, as that of a rack, increases in one direction and decreases in the other."""
    ends = [c.nodes[-1].u - c.nodes[0].u for c in (forward, backward) if c.ended in ("range", "limit")]
    return not forward.period and len(ends) == 2 and ends[0] * ends[1] < 0


def _crossings_of(curve: PoseCurve, u: float) -> list[CurvePoint]:
    """Trace a curve, and return its points with the input u, beginning with its first point."""
    reach = MAX_DISPLACEMENT * curve.unit
    crossings = [curve.nodes[0]]
    try:
        follow(curve, u - reach, u + reach)
        for i, (a, b) in enumerate(pairwise(curve.nodes)):
            for (s0, p0), (s1, p1) in pairwise(_monotonic_points(curve, i, a, b)):
                crossings += [_crossing_point(curve, i, (s0, s1), w) for w in _levels_between(curve, u, p0, p1)]
    except (StepError, ValueError, np.linalg.LinAlgError):  # a singular pose: keep the poses before it
        curve.ended = "failed"
    return crossings


def _monotonic_points(curve: PoseCurve, i: int, a: CurvePoint, b: CurvePoint) -> list[tuple[float, CurvePoint]]:
    """Return points of a step between which the input is monotonic: its ends, and a dead point in between."""
    ends = [(0.0, a), (b.s - a.s, b)]
    if a.speed * b.speed >= 0 or min(abs(a.speed), abs(b.speed)) < ZERO_SPEED * curve.unit:
        return ends
    ds = curve.root(i, lambda p: p.speed)
    return [ends[0], (ds, curve.at(i, ds)), ends[1]]


def _levels_between(curve: PoseCurve, u: float, p0: CurvePoint, p1: CurvePoint) -> Iterator[float]:
    """Yield the values u + 2 pi k that the input crosses between two points."""
    low, high = sorted((p0.u - u, p1.u - u))
    tolerance = SAME_POSE * curve.unit
    revolutions = range(1)
    if curve.period:
        first, last = (low - tolerance) / curve.period, (high + tolerance) / curve.period
        revolutions = range(int(np.ceil(first)), int(np.floor(last)) + 1)
    for k in revolutions:
        w = u + k * curve.period
        sides = [_is_above(curve, p, w) for p in (p0, p1)]
        if sides[0] != sides[1]:
            yield w


def _is_above(curve: PoseCurve, p: CurvePoint, w: float) -> bool:
    """Return whether the input is above w; at the first pose of a circuit, where it is w, at the neighbouring point."""
    first, last = p is curve.nodes[0], curve.ended == "closed" and p is curve.nodes[-1]
    if not (first or last) or abs(p.u - w) > SAME_POSE * curve.unit:
        return p.u >= w
    sign = _rate_sign(p, curve)
    return (p.input_curvature if not sign else sign if first else -sign) > 0


def _rate_sign(p: CurvePoint, curve: PoseCurve) -> int:
    """Return the sign of du/ds, 0 at a dead point."""
    return int(np.sign(p.speed)) if abs(p.speed) > ZERO_SPEED * curve.unit else 0


def _crossing_point(curve: PoseCurve, i: int, step: tuple[float, float], w: float) -> CurvePoint:
    """Return the point after node i with the input w, within a range of arclengths of the step."""
    low, high = (curve.at(i, ds).u - w for ds in step)
    if low * high < 0:
        point = curve.at(i, float(brentq(lambda x: curve.at(i, x).u - w, *step, xtol=COINCIDENT)))
    else:
        point = curve.at(i, step[0] if abs(low) < abs(high) else step[1])
    return curve.at_input(point, w) or point
