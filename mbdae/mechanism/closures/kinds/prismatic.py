"""The prismatic closure."""

from typing import Literal

from ..frame_joint import AxisJoint


class PrismaticClosure(AxisJoint):
    """5 rows: b slides along the axis of a and does not turn."""

    kind: Literal["prismatic"] = "prismatic"
    gap, direction, friction, carried = "across", "frame", "slides", 2
