"""The rolling closure."""

from math import pi
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ....errors import StepError
from ....system import Array
from ....tolerances import THREE_DIGITS
from ...key_units import Unit
from ...tree.frames import Pair
from ..closure import Axis, UnilateralClosure, Vector
from ..contact import ContactHeightRow, ConvexBody, NoSlipRows
from ..rows import unit_axis

NO_SLIP_ANGLES = {"full": (0.0, pi / 2), "longitudinal": (0.0,), "lateral": (pi / 2,), "none": ()}


class RollingClosure(UnilateralClosure):
    """3 rows: b rolls on a plane (z of a), sphere or cylinder of a: it touches the surface and does not slip.

    The body is a disc or torus (``radius``, ``tyre``, ``axis``), a sphere (``tyre`` equal to the radius, or no ``tyre``
    and no ``axis``) or an ellipsoid (``semi_axes``, ``centre``). The rows are the contact gap (multiplier N > 0 under
    compression), then no slip forwards and no slip to the left of the wheel; for a body without an axle on a plane,
    along x and y of a. Without ``contact``, joints must keep the body on the surface.

    Attributes:
        radius: outer radius of a wheel or sphere in m.
        tyre: radius of the section of a wheel's tyre in m: 0 when left out, a knife edge; ``radius`` for a sphere.
        axis: axle of a wheel in the second frame, pointing to its left.
        semi_axes: semi-axes of an ellipsoid along the axes of the second frame, in m.
        centre: centre of an ellipsoid in the second frame, in m; its origin when left out.
        grip: no-slip directions: ``"full"`` when left out, ``"lateral"``, ``"longitudinal"``, ``"none"``, or one
            direction at an angle in rad from forwards to the left (rollers of omni and mecanum wheels).
        contact: whether the closure keeps the body on the surface; false if joints do so. True when left out.
        surface: the x-y plane of the first frame when left out; spheres may also roll on a sphere or cylinder.
        surface_radius: radius of a spherical or cylindrical surface in m; negative if the body rolls inside.
    """

    kind: Literal["rolling"] = "rolling"
    radius: Annotated[float | None, Unit("m")] = Field(default=None, gt=0)
    tyre: Annotated[float | None, Unit("m")] = Field(default=None, ge=0)
    axis: Axis | None = None
    semi_axes: Annotated[Vector | None, Unit("m")] = None
    centre: Annotated[Vector | None, Unit("m")] = None
    grip: Annotated[Literal["full", "lateral", "longitudinal", "none"] | float | None, Unit("rad")] = None
    contact: bool | None = None
    surface: Literal["plane", "sphere", "cylinder"] | None = None
    surface_radius: Annotated[float | None, Unit("m")] = None
    friction, distinct_frames = "surface", True

    @model_validator(mode="after")
    def _check_body(self) -> "RollingClosure":
        if (self.radius is None) == (self.semi_axes is None):
            raise ValueError("a rolling closure needs one of radius and semi_axes")
        if self.semi_axes and (self.tyre is not None or self.axis is not None or min(self.semi_axes) <= 0):
            raise ValueError("semi_axes are positive, and tyre and axis belong to radius")
        if self.radius and (self.centre is not None or (self.tyre or 0) > self.radius):
            raise ValueError("centre belongs to semi_axes, and tyre is at most radius")
        if self.radius and self.axis is None and self.tyre not in (None, self.radius):
            raise ValueError("a wheel needs its axis; without one it is a sphere, whose tyre is its radius")
        return self

    @model_validator(mode="after")
    def _check_surface(self) -> "RollingClosure":
        if not self.primitives():
            raise ValueError("there is no row: grip is 'none' and contact is false")
        radius = self.surface_radius
        if (radius is None) != (self.shape.surface == "plane"):
            raise ValueError("surface_radius belongs to surface 'sphere' or 'cylinder', which need it")
        if radius is None:
            return self
        if self.axis or self.semi_axes or self.grip not in (None, "full", "none"):
            raise ValueError("only spheres without an axis roll on spheres and cylinders, with grip 'full' or 'none'")
        if not radius or (radius < 0 and -radius <= (self.radius or 0)):
            raise ValueError("surface_radius is not zero, and a sphere inside is smaller")
        return self

    @property
    def no_slip_angles(self) -> tuple[float, ...]:
        """No-slip directions: angles in rad from forwards to the left."""
        grip = "full" if self.grip is None else self.grip
        return NO_SLIP_ANGLES[grip] if isinstance(grip, str) else (grip,)

    @property
    def shape(self) -> ConvexBody:
        """Body and surface."""
        radius = self.radius or 0.0
        tyre = radius if self.axis is None else self.tyre or 0.0
        axle = tuple(unit_axis(self.axis).tolist()) if self.axis else None
        centre = self.centre or (0.0, 0.0, 0.0)
        surface, surface_radius = self.surface or "plane", self.surface_radius or 0.0
        return ConvexBody(axle, radius - tyre, tyre, self.semi_axes, centre, surface, surface_radius)

    def primitives(self) -> tuple[ContactHeightRow | NoSlipRows, ...]:
        height = () if self.contact is False else (ContactHeightRow(self.shape),)
        return (*height, NoSlipRows(self.shape, self.no_slip_angles)) if self.no_slip_angles else height

    @property
    def has_precondition(self) -> bool:
        return self.contact is False

    def violated_precondition(self, pair: Pair, relative: Array) -> str:
        try:
            height = self.shape.height(pair)
        except StepError:  # a wheel that lies flat, which the row reports
            return ""
        size = self.radius or max(self.semi_axes or (1.0,))
        if abs(height) <= THREE_DIGITS * size:
            return ""
        return f"contact is false, and joints do not keep it on its surface: it is {height:.3g} m off"

    @classmethod
    def create(
        cls, a: str, b: str, radius: float, axis: Axis | None = None, name: str = "", **more: Any
    ) -> "RollingClosure":
        """A wheel of b with its axle, or a sphere, rolls on the x-y plane of a; further keys by name."""
        return cls(frames=(a, b), radius=radius, axis=axis, name=name, **more)
