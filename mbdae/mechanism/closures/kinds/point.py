"""The point closure."""

from typing import Literal

from ..frame_joint import FrameJoint


class PointClosure(FrameJoint):
    """3 rows: the origins coincide (spherical joint)."""

    kind: Literal["point"] = "point"
    translation, friction, normal_force_rows, coincident_origins = "all", "spherical", 3, True

    @classmethod
    def create(cls, a: str, b: str, name: str = "") -> "PointClosure":
        """Between frames a and b."""
        return cls(frames=(a, b), name=name)
