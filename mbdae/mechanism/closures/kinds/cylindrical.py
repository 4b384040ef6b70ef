"""The cylindrical closure."""

from typing import Literal

from ..closure import Axis, Z
from ..frame_joint import TwoAxisJoint


class CylindricalClosure(TwoAxisJoint):
    """4 rows: b slides along the axis of a and turns about it."""

    kind: Literal["cylindrical"] = "cylindrical"
    gap, direction, friction, carried = "across", "axis", "slides", 2

    @classmethod
    def of(
        cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None
    ) -> "CylindricalClosure":
        """Between frames a and b, with an axis of a and the corresponding one of b, the same when left out."""
        return cls(frames=(a, b), axis=axis, second_axis=second_axis, name=name)
