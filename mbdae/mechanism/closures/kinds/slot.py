"""The slot closure."""

from typing import Literal

from ..closure import BetweenFrames
from ..profile_rows import Roller
from ..profiles import AnyProfile, Profile


class SlotClosure(BetweenFrames):
    """1 row: the projection of b's origin onto the x-y plane of a stays on a curve.

    Attributes:
        profile: the curve in the x-y plane of the first frame.
    """

    kind: Literal["slot"] = "slot"
    profile: Profile
    friction, distinct_frames = "surface", True

    def primitives(self) -> tuple[Roller]:
        return (Roller(self.profile.path, 0.0),)

    @classmethod
    def create(cls, a: str, b: str, profile: AnyProfile, name: str = "") -> "SlotClosure":
        """Create the closure of two frames, whose curve lies in the x-y plane of a."""
        return cls(frames=(a, b), profile=profile, name=name)
