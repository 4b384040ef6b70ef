"""The point closure."""

from typing import Literal

from ..frame_joint import FrameJoint


class PointClosure(FrameJoint):
    """3 rows: the origins coincide (spherical joint)."""

    kind: Literal["point"] = "point"
    gap, friction, carried, meets = "all", "bears", 3, True

    @classmethod
    def of(cls, a: str, b: str, name: str = "") -> "PointClosure":
        """Between frames a and b."""
        return cls(frames=(a, b), name=name)
