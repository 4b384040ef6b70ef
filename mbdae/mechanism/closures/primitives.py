"""Primitive rows of each kind of closure."""

from collections.abc import Sequence
from math import pi
from typing import TYPE_CHECKING

from .contact import ContactHeightRow, NoSlipRows
from .key_rules import BETWEEN_FRAMES
from .line_rows import Bevel, Gear, KnifeEdge, Screw
from .profile_rows import FlatFace, Roller
from .rows import Coordinate, Distance, FrameRows, JointRow, MotionLawRow, Ratio, Sum, between_frames, unit_axis

if TYPE_CHECKING:
    from .closure import Closure

Z = (0.0, 0.0, 1.0)


def primitives_of(closure: "Closure") -> Sequence[FrameRows] | Sequence[JointRow]:
    """Return the rows of a closure, in their order."""
    axis = closure.axis or Z
    if closure.joints:
        return (_between_joints(closure, closure.joints),)
    if closure.kind == "distance":
        return (Distance(float(closure.length or 0)),)
    if closure.kind in BETWEEN_FRAMES:
        return between_frames(*BETWEEN_FRAMES[closure.kind], axis, closure.other_axis)
    if closure.profile and closure.radius is None and closure.kind == "cam":
        return (FlatFace(closure.profile.path, unit_axis(axis)),)
    if closure.profile:
        return (Roller(closure.profile.path, closure.radius or 0.0),)
    if closure.kind == "rolling":
        grip = NoSlipRows(closure.shape, closure.tangents)
        return (
            *((ContactHeightRow(closure.shape),) if closure.contact is not False else ()),
            *((grip,) if grip.m else ()),
        )
    if closure.kind == "gear":
        a, b = closure.radii or (1.0, 1.0)
        return (Gear(unit_axis(axis), a / (a + b)),)
    if closure.kind == "bevel":
        return (Bevel(unit_axis(axis), unit_axis(closure.other_axis), closure.radii or (1.0, 1.0)),)
    if closure.kind == "screw":
        return (Screw(unit_axis(axis), (closure.lead or 0.0) / (2 * pi)),)
    return (KnifeEdge(unit_axis(axis)),)


def _between_joints(closure: "Closure", joints: tuple[str, ...]) -> JointRow:
    (i, j, *k), c = joints, closure.coefficients or ()
    if closure.kind == "ratio":
        return Ratio(i, j, k[0] if k else "", c)
    if closure.curve:
        return MotionLawRow(i, j, closure.curve)
    return Sum(joints, c) if k else Coordinate(i, j, c)
