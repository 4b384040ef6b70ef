"""The bevel closure."""

from typing import Annotated, Literal

import numpy as np
from pydantic import field_validator

from ....data_types import CoreData
from ....errors import StepError
from ....system import Array
from ....tolerances import PARALLEL, THREE_DIGITS
from ...key_units import Unit
from ...tree.frames import Pair, cross
from ..closure import Axis, Z
from ..fixed_axes import FixedAxisClosure
from ..line_rows import LineRows, Lines, unit
from ..rows import axis_rates, inner, point_velocity_column, unit_axis

Radii = tuple[float, float]


class BevelClosure(FixedAxisClosure):
    """1 row: wheels about intersecting axes do not slip on each other: r_a w_a = -r_b w_b relative to their carrier.

    The axes must intersect at a constant angle.

    Attributes:
        radii: radii of both wheels in m; negative for a ring gear with internal teeth.
        second_axis: axis in the second frame; the same components when left out. Both axes point from their
            intersection to the wheels.
    """

    kind: Literal["bevel"] = "bevel"
    radii: Annotated[Radii, Unit("m")]
    second_axis: Axis | None = None
    free_rotation_message = "its wheels can rotate about an axis that is not in the plane of the given axes"

    @field_validator("radii")
    @classmethod
    def _require_nonzero(cls, radii: Radii) -> Radii:
        if not all(radii):
            raise ValueError("radii must not be zero")
        return radii

    def axes(self) -> tuple[Array, Array]:
        """Return the unit axes of both wheels in their frames, (3,) each."""
        return unit_axis(self.axis), unit_axis(self.second_axis or self.axis)

    def primitives(self) -> "tuple[Bevel]":
        return (Bevel(*self.axes(), self.radii),)

    def violated_precondition(self, pair: Pair, relative: Array) -> str:
        (a, b), (ra, rb) = self.axes(), self.radii
        ka, kb = pair.Ra @ a, pair.Rb @ b
        e = np.cross(ka, kb)
        distance = abs(float((pair.pb - pair.pa) @ e)) / float(np.linalg.norm(e))
        if distance > THREE_DIGITS * (abs(ra) + abs(rb)):
            return f"its axes do not intersect: their distance is {distance:.3g} m"
        angle, before = (float(np.arccos(np.clip(x, -1, 1))) for x in (ka @ kb, (relative @ a) @ b))
        changed = abs(angle - before) > THREE_DIGITS
        return f"the angle between its axes has changed from {before:.4g} to {angle:.4g} rad" if changed else ""

    def excluded_axes(self, pair: Pair) -> tuple[Array, str]:
        a, b = self.axes()
        return np.cross(pair.Ra @ a, pair.Rb @ b)[None], self.free_rotation_message

    @classmethod
    def create(
        cls, a: str, b: str, radii: Radii, axis: Axis = Z, second_axis: Axis = Z, name: str = ""
    ) -> "BevelClosure":
        """Wheels about ``axis`` of a and ``second_axis`` of b, which intersect, do not slip on each other."""
        return cls(frames=(a, b), radii=radii, axis=axis, second_axis=second_axis, name=name)


class Bevel(LineRows):
    """Wheels of a and b about intersecting axes, (3,) in each frame, do not slip on each other.

    The row is along e = k_a x k_b/|.|, perpendicular to both axes, through the point at which the pitch cones touch, at
    distances r_a and r_b from the axes: (p - p_a) . (e x k_a) = r_a, (p - p_b) . (k_b x e) = r_b. Hence r_a w_a +
    r_b w_b = 0 relative to the carrier of both axes, wherever on these axes the frames are. The multiplier is the
    tangential force in N.
    """

    m = 1

    def __init__(self, a: Array, b: Array, radii: tuple[float, float]) -> None:
        self.a, self.b, self.radii = a[:, None], b[:, None], radii

    def core_data(self) -> list[CoreData]:
        a, b = self.a[:, 0].tolist(), self.b[:, 0].tolist()
        return [{"kind": "bevel", "a": a, "b": b, "length": self.radii[0], "other_length": self.radii[1]}]

    def lines(self, pair: Pair) -> Lines:
        ka, kb = pair.Ra.dot(self.a), pair.Rb.dot(self.b)
        dka, dkb = axis_rates(pair.Va, ka), axis_rates(pair.Vb, kb)
        across = cross(ka, kb)
        if not np.sqrt(inner(across, across)).real > PARALLEL:
            raise StepError("singular", "its axes are parallel: use kind 'gear'")
        e, de = unit(across, cross(dka, kb) + cross(ka, dkb))
        n = np.hstack([cross(e, ka), cross(kb, e), e])
        dn = np.hstack([cross(de, ka) + cross(e, dka), cross(dkb, e) + cross(kb, de), de])
        at, va = np.column_stack([pair.pa, pair.pb, pair.pa]), point_velocity_column(pair.Va, pair.pa)
        speed = np.hstack([va, point_velocity_column(pair.Vb, pair.pb), va])
        p = np.linalg.solve(n.T, (n * at).sum(axis=0) + np.array([*self.radii, 0.0]))
        dp = np.linalg.solve(n.T, (dn * (at - p[:, None]) + n * speed).sum(axis=0))
        return Lines(e, p[:, None], de, dp[:, None])
