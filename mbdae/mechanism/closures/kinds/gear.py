"""The gear closure."""

from typing import Annotated, Literal

import numpy as np
from pydantic import field_validator

from ....data_types import CoreData
from ....errors import StepError
from ....system import Array
from ....tolerances import THREE_DIGITS
from ...key_units import Unit
from ...tree.frames import Pair, cross
from ..closure import Axis, Z
from ..fixed_axes import FixedAxisClosure
from ..line_rows import LineRows, Lines, unit
from ..rows import axis_rates, point_velocity_column, unit_axis

Radii = tuple[float, float]


class GearClosure(FixedAxisClosure):
    """1 row: wheels about parallel axes do not slip at the pitch point, which is set by the ratio of the radii.

    The axes must stay parallel, at the distance |r_a + r_b|.

    Attributes:
        radii: radii of both wheels in m; negative for a ring gear with internal teeth.
    """

    kind: Literal["gear"] = "gear"
    radii: Annotated[Radii, Unit("m")]
    distinct_frames = True
    free_rotation_message = "its wheels can rotate about axes that are not parallel: use kind 'bevel' if they intersect"

    @field_validator("radii")
    @classmethod
    def _require_nonzero(cls, radii: Radii) -> Radii:
        if not all((*radii, sum(radii))):
            raise ValueError("radii must not be zero, nor their sum")
        return radii

    def primitives(self) -> "tuple[Gear]":
        a, b = self.radii
        return (Gear(unit_axis(self.axis), a / (a + b)),)

    def violated_precondition(self, pair: Pair, relative: Array) -> str:
        if angle := self.tilt(pair, relative):
            return f"its axes are not parallel, but at an angle of {angle:.3g} rad"
        k, d, (a, b) = pair.Ra @ unit_axis(self.axis), pair.pb - pair.pa, self.radii
        distance = float(np.linalg.norm(d - k * (k @ d)))
        if abs(distance - abs(a + b)) <= THREE_DIGITS * (abs(a) + abs(b)):
            return ""
        return f"its axes are {distance:.4g} m apart, but radii of {a:g} and {b:g} m require {abs(a + b):.4g} m"

    @classmethod
    def create(cls, a: str, b: str, radii: Radii, axis: Axis = Z, name: str = "") -> "GearClosure":
        """Wheels about parallel axes through the origins of a and b do not slip on each other."""
        return cls(frames=(a, b), radii=radii, axis=axis, name=name)


class Gear(LineRows):
    """Wheels of a and b about parallel axes, an axis of a (3,), do not slip at the pitch point.

    The pitch point divides the line of centres in proportion to the radii: p = p_a + fraction (p_b - p_a), fraction =
    r_a/(r_a + r_b); the row is along e = k x (p_b - p_a)/|.|.
    """

    m = 1

    def __init__(self, axis: Array, fraction: float) -> None:
        self.axis, self.fraction = axis[:, None], fraction

    def core_data(self) -> list[CoreData]:
        return [{"kind": "gear", "a": self.axis[:, 0].tolist(), "length": self.fraction}]

    def lines(self, pair: Pair) -> Lines:
        pa, va = pair.pa[:, None], point_velocity_column(pair.Va, pair.pa)
        d, dd = pair.pb[:, None] - pa, point_velocity_column(pair.Vb, pair.pb) - va
        k = pair.Ra.dot(self.axis)
        if not (along := cross(k, d)).any():
            raise StepError("singular", "the axes of its wheels coincide: they have no line of centres")
        e, de = unit(along, cross(axis_rates(pair.Va, k), d) + cross(k, dd))
        return Lines(e, pa + self.fraction * d, de, va + self.fraction * dd)
