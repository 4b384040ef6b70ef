"""The revolute closure."""

from typing import Literal

from ..closure import Axis, Z
from ..frame_joint import TwoAxisJoint


class RevoluteClosure(TwoAxisJoint):
    """5 rows: the origins coincide, and the axes keep one direction."""

    kind: Literal["revolute"] = "revolute"
    gap, direction, friction, carried, meets = "all", "axis", "turns", 3, True

    @classmethod
    def of(
        cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None
    ) -> "RevoluteClosure":
        """Between frames a and b, with an axis of a and the corresponding one of b, the same when left out."""
        return cls(frames=(a, b), axis=axis, second_axis=second_axis, name=name)
