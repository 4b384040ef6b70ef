"""The universal closure."""

from typing import Literal

from ..closure import Axis, X, Z
from ..frame_joint import TwoAxisJoint, Vector


class UniversalClosure(TwoAxisJoint):
    """4 rows: the origins coincide, and the axis of a is perpendicular to the second axis, of b.

    Attributes:
        second_axis: the axis in the second frame; x when left out.
    """

    kind: Literal["universal"] = "universal"
    translation, direction, coincident_origins = "all", "perpendicular", True

    def axes(self) -> tuple[Vector, Vector]:
        return self.axis, self.second_axis or X

    @classmethod
    def create(  # type: ignore[override]
        cls, a: str, b: str, axis: Axis = Z, second_axis: Axis = X, name: str = ""
    ) -> "UniversalClosure":
        """Between frames a and b, with an axis of each."""
        return cls(frames=(a, b), axis=axis, second_axis=second_axis, name=name)
