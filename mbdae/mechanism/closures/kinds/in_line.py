"""The in_line closure."""

from typing import Literal

from ..frame_joint import AxisJoint


class InLineClosure(AxisJoint):
    """2 rows: b's origin stays on the line through a's origin along the axis of a."""

    kind: Literal["in_line"] = "in_line"
    translation, friction, normal_force_rows = "across", "prismatic", 2
