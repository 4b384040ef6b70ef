"""The cylindrical closure."""

from typing import Literal

from ..frame_joint import TwoAxisJoint


class CylindricalClosure(TwoAxisJoint):
    """4 rows: b slides along the axis of a and rotates about it."""

    kind: Literal["cylindrical"] = "cylindrical"
    translation, direction, friction, normal_force_rows = "across", "axis", "prismatic", 2
