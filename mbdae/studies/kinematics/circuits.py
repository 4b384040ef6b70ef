"""Circuits: the curve through an assembly mode, and all poses on it in which the input comes to the mode's value.

On a closed curve of regular poses the signs of du/ds at the passages of one value add up to 0 where the input slides,
and to the number of turns of the input where it turns. So each circuit has an even number of modes of an input that
slides.
Source: Chase, Mirth, J. Mech. Design 115 (1993); the degree of a map of the circle.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import brentq

from ...errors import StepError
from ...system import Array
from ...tolerances import COINCIDENT, SAME_POSE, STILL
from .pose_curve import LONGEST, CurvePoint, PoseCurve

if TYPE_CHECKING:
    from ...mechanism.formulations.index2 import Index2System



class Circuit(NamedTuple):
    """A curve of poses.

    Attributes:
        passed: where the input has the value of the first pose, up to full turns: q (nq,), and whether it rises.
        warning: why there may be more; empty for none.
    """

    passed: list[tuple[Array, bool]]
    warning: str


def circuit(system: "Index2System", angular: Array, period: float, q: Array, u: float) -> Circuit:
    """Follow the circuit of a closed pose q (nq,) at the input u.

    Args:
        system: a workspace of `mbdae.studies.kinematics.driven_mechanism.driven_mechanism`.
        angular: which coordinates are angles, (nv,).
        period: of the input, 2 pi for an angle, else 0.
        q: the pose.
        u: the input there.
    """
    curve = PoseCurve(system, angular, period)
    try:
        first = curve.begin(q, u)
    except (StepError, np.linalg.LinAlgError):
        return Circuit([(q, True)], "its first pose is singular")
    passages = _passages(curve, u)
    if curve.ended == "closed":
        turns = round((curve.nodes[-1].u - first.u) / period) if period else 0
        signs = sum(_side(p, curve) for p in passages)
        warning = "" if signs == turns else f"the input rises and falls {len(passages)} times, which does not add up"
    else:
        back = PoseCurve(system, angular, period)
        back.begin(q, u, -first.tau)
        turned = _passages(back, u)
        passages += [p._replace(tau=-p.tau, speed=-p.speed) for p in turned[1:]]
        warning = "it was not followed back to its first pose"
    return Circuit([(p.q, p.speed > 0) for p in passages], warning)


def _passages(curve: PoseCurve, u: float) -> list[CurvePoint]:
    """Follow a curve, and return the points of it with the input u, the first one before all others."""
    far = LONGEST * curve.unit
    passages = [curve.nodes[0]]
    try:
        curve.follow(u - far, u + far)
        for i, (a, b) in enumerate(pairwise(curve.nodes)):
            for (s0, p0), (s1, p1) in pairwise(_monotone(curve, i, a, b)):
                passages += [_passage(curve, i, (s0, s1), w) for w in _between(curve, u, p0, p1)]
    except (StepError, ValueError, np.linalg.LinAlgError):  # a singular pose: the poses before it count
        curve.ended = "stuck"
    return passages


def _monotone(curve: PoseCurve, i: int, a: CurvePoint, b: CurvePoint) -> list[tuple[float, CurvePoint]]:
    """Points of a step between which the input rises or falls: its ends, and a dead point between them."""
    ends = [(0.0, a), (b.s - a.s, b)]
    if a.speed * b.speed >= 0 or min(abs(a.speed), abs(b.speed)) < STILL * curve.unit:
        return ends
    sigma = curve.zero(i, lambda p: p.speed)
    return [ends[0], (sigma, curve.at(i, sigma)), ends[1]]


def _between(curve: PoseCurve, u: float, p0: CurvePoint, p1: CurvePoint) -> Iterator[float]:
    """The values u + 2 pi k of the input that are passed between two points."""
    low, high = sorted((p0.u - u, p1.u - u))
    near = SAME_POSE * curve.unit
    turns = range(1)
    if curve.period:
        turns = range(int(np.ceil((low - near) / curve.period)), int(np.floor((high + near) / curve.period)) + 1)
    for k in turns:
        w = u + k * curve.period
        sides = [_beside(curve, p, w) for p in (p0, p1)]
        if sides[0] != sides[1]:
            yield w


def _beside(curve: PoseCurve, p: CurvePoint, w: float) -> bool:
    """Whether the input is above w; beside the first pose of a circuit, which is at w, where it is within the curve."""
    first, last = p is curve.nodes[0], curve.ended == "closed" and p is curve.nodes[-1]
    if not (first or last) or abs(p.u - w) > SAME_POSE * curve.unit:
        return p.u >= w
    side = _side(p, curve)
    return (p.bend if not side else side if first else -side) > 0


def _side(p: CurvePoint, curve: PoseCurve) -> int:
    """The sign of the input's rate, 0 at a dead point."""
    return int(np.sign(p.speed)) if abs(p.speed) > STILL * curve.unit else 0


def _passage(curve: PoseCurve, i: int, step: tuple[float, float], w: float) -> CurvePoint:
    """The point behind node i with the input w, in a part of the step."""
    low, high = (curve.at(i, sigma).u - w for sigma in step)
    if low * high < 0:
        at = curve.at(i, float(brentq(lambda x: curve.at(i, x).u - w, *step, xtol=COINCIDENT)))
    else:
        at = curve.at(i, step[0] if abs(low) < abs(high) else step[1])
    return curve.at_input(at, w) or at
