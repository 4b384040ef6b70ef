"""The parallel closure."""

from typing import Literal

from ..closure import Axis, Z
from ..frame_joint import TwoAxisJoint


class ParallelClosure(TwoAxisJoint):
    """2 rows: the axes keep one direction."""

    kind: Literal["parallel"] = "parallel"
    direction = "axis"

    @classmethod
    def of(
        cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None
    ) -> "ParallelClosure":
        """Between frames a and b, with an axis of a and the corresponding one of b, the same when left out."""
        return cls(frames=(a, b), axis=axis, second_axis=second_axis, name=name)
