"""The parallel closure."""

from typing import Literal

from ..frame_joint import TwoAxisJoint


class ParallelClosure(TwoAxisJoint):
    """2 rows: the axes are parallel."""

    kind: Literal["parallel"] = "parallel"
    direction = "axis"
