"""The frame closure."""

from typing import Literal

from ..frame_joint import FrameJoint


class FrameClosure(FrameJoint):
    """6 rows: the frames coincide (weld)."""

    kind: Literal["frame"] = "frame"
    translation, direction, coincident_origins = "all", "frame", True

    @classmethod
    def create(cls, a: str, b: str, name: str = "") -> "FrameClosure":
        """Between frames a and b."""
        return cls(frames=(a, b), name=name)
