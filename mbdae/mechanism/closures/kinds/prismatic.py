"""The prismatic closure."""

from typing import Literal

from ..closure import Axis, Z
from ..frame_joint import AxisJoint


class PrismaticClosure(AxisJoint):
    """5 rows: b slides along the axis of a and does not turn."""

    kind: Literal["prismatic"] = "prismatic"
    gap, direction, friction, carried = "across", "frame", "slides", 2

    @classmethod
    def of(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> "PrismaticClosure":
        """Between frames a and b, with an axis of a."""
        return cls(frames=(a, b), axis=axis, name=name)
