"""The cam closure."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ....system import Array
from ....tolerances import THREE_DIGITS
from ...key_units import Unit
from ...tree.frames import Pair
from ..closure import Axis, BetweenFrames
from ..profile_rows import FlatFace, Roller
from ..profiles import AnyProfile, Profile
from ..rows import unit_axis


class CamClosure(BetweenFrames):
    """1 row: a roller or a flat face of b touches a profile in the x-y plane of a.

    A flat face must be perpendicular to the plane of the profile.

    Attributes:
        profile: profile in the x-y plane of the first frame.
        radius: radius of the roller about b's origin, in m; or
        axis: normal of the flat face through b's origin, in the second frame, pointing away from the cam.
    """

    kind: Literal["cam"] = "cam"
    profile: Profile
    radius: Annotated[float | None, Unit("m")] = Field(default=None, gt=0)
    axis: Axis | None = None
    distinct_frames = True

    @model_validator(mode="after")
    def _check_follower(self) -> "CamClosure":
        if (self.radius is None) == (self.axis is None):
            raise ValueError("a cam needs one of radius, of its roller, and axis, of its flat face")
        self.profile.path.require_regular(self.radius)
        return self

    def primitives(self) -> tuple[FlatFace | Roller]:
        if self.axis:
            return (FlatFace(self.profile.path, unit_axis(self.axis)),)
        return (Roller(self.profile.path, self.radius or 0.0),)

    @property
    def has_precondition(self) -> bool:
        return self.axis is not None

    def violated_precondition(self, pair: Pair, relative: Array) -> str:
        tilt = abs(float(pair.Rb @ unit_axis(self.axis) @ pair.Ra[:, 2])) if self.axis else 0.0
        message = f"its flat face deviates by {tilt:.3g} rad from a right angle to the plane of the profile"
        return message if tilt > THREE_DIGITS else ""

    @classmethod
    def create(cls, a: str, b: str, profile: AnyProfile, name: str = "", **more: Any) -> "CamClosure":
        """A roller (``radius``) or a flat face (``axis``) of b touches a profile of a."""
        return cls(frames=(a, b), profile=profile, name=name, **more)
