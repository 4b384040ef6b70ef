"""The revolute closure."""

from typing import Literal

from ..frame_joint import TwoAxisJoint


class RevoluteClosure(TwoAxisJoint):
    """5 rows: the origins coincide, and the axes keep one direction."""

    kind: Literal["revolute"] = "revolute"
    gap, direction, friction, carried, meets = "all", "axis", "turns", 3, True
