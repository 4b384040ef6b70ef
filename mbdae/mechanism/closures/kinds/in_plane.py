"""The in_plane closure."""

from typing import Literal

from ..closure import UnilateralClosure
from ..frame_joint import AxisJoint


class InPlaneClosure(AxisJoint, UnilateralClosure):
    """1 row: b's origin stays in the plane through a's origin with the axis of a as normal."""

    kind: Literal["in_plane"] = "in_plane"
    translation, friction = "along", "surface"
