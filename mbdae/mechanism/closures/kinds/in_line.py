"""The in_line closure."""

from typing import Literal

from ..closure import Axis, Z
from ..frame_joint import AxisJoint


class InLineClosure(AxisJoint):
    """2 rows: b's origin stays on the line through a's origin along the axis of a."""

    kind: Literal["in_line"] = "in_line"
    gap, friction, carried = "across", "slides", 2

    @classmethod
    def of(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> "InLineClosure":
        """Between frames a and b, with an axis of a."""
        return cls(frames=(a, b), axis=axis, name=name)
