"""The revolute closure."""

from typing import Literal

from ..frame_joint import TwoAxisJoint


class RevoluteClosure(TwoAxisJoint):
    """5 rows: the origins coincide, and the axes are parallel."""

    kind: Literal["revolute"] = "revolute"
    translation, direction, friction, normal_force_rows, coincident_origins = "all", "axis", "revolute", 3, True
