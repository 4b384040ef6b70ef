"""The in_plane closure."""

from typing import Literal

from ..closure import Axis, UnilateralClosure, Z
from ..frame_joint import AxisJoint


class InPlaneClosure(AxisJoint, UnilateralClosure):
    """1 row: b's origin stays in the plane through a's origin with the axis of a as normal."""

    kind: Literal["in_plane"] = "in_plane"
    gap, friction = "along", "touches"

    @classmethod
    def of(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> "InPlaneClosure":
        """Between frames a and b, with a normal of a."""
        return cls(frames=(a, b), axis=axis, name=name)
