"""The prismatic closure."""

from typing import Literal

from ..frame_joint import AxisJoint


class PrismaticClosure(AxisJoint):
    """5 rows: b slides along the axis of a and does not rotate."""

    kind: Literal["prismatic"] = "prismatic"
    translation, direction, friction, normal_force_rows = "across", "frame", "prismatic", 2
