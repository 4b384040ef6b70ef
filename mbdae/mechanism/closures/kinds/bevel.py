"""The bevel closure."""

from typing import Any, Literal

import numpy as np
from pydantic import field_validator

from ....errors import StepError
from ....system import Array
from ....tolerances import PARALLEL, THREE_DIGITS
from ...frames import Pair, cross
from ..closure import Axis, Z
from ..fixed_axes import FixedAxisClosure
from ..line_rows import LineRows, Lines, unit
from ..rows import displaced, rotated, unit_axis

Radii = tuple[float, float]


class BevelClosure(FixedAxisClosure):
    """1 row: wheels about axes that meet do not slip on each other: r_a w_a = -r_b w_b on their carrier.

    The axes must meet at a constant angle.

    Attributes:
        radii: of both wheels in m; negative for a ring whose teeth point inwards.
        second_axis: in the second frame; the same components when left out. Both axes point from their intersection to
            the wheels.
    """

    kind: Literal["bevel"] = "bevel"
    radii: Radii
    second_axis: Axis | None = None
    otherwise = "its wheels can turn about other axes than those given, in the plane of both"

    @field_validator("radii")
    @classmethod
    def _roll(cls, radii: Radii) -> Radii:
        if not all(radii):
            raise ValueError("radii must not be zero")
        return radii

    def axes(self) -> tuple[Array, Array]:
        """Unit axes of both wheels in their frames, (3,) each."""
        return unit_axis(self.axis), unit_axis(self.second_axis or self.axis)

    def primitives(self) -> "tuple[Bevel]":
        return (Bevel(*self.axes(), self.radii),)

    def unfit(self, pair: Pair, relative: Array) -> str:
        (a, b), (ra, rb) = self.axes(), self.radii
        ka, kb = pair.Ra @ a, pair.Rb @ b
        e = np.cross(ka, kb)
        past = abs(float((pair.pb - pair.pa) @ e)) / float(np.linalg.norm(e))
        if past > THREE_DIGITS * (abs(ra) + abs(rb)):
            return f"its axes do not meet, they pass each other at {past:.3g} m"
        here, before = (float(np.arccos(np.clip(x, -1, 1))) for x in (ka @ kb, (relative @ a) @ b))
        changed = abs(here - before) > THREE_DIGITS
        return f"the angle of its axes is {here:.4g} rad, after {before:.4g} rad" if changed else ""

    def foreign_axes(self, pair: Pair) -> tuple[Array, str]:
        a, b = self.axes()
        return np.cross(pair.Ra @ a, pair.Rb @ b)[None], self.otherwise

    @classmethod
    def of(cls, a: str, b: str, radii: Radii, axis: Axis = Z, second_axis: Axis = Z, name: str = "") -> "BevelClosure":
        """Wheels about ``axis`` of a and ``second_axis`` of b, which meet, do not slip on each other."""
        return cls(frames=(a, b), radii=radii, axis=axis, second_axis=second_axis, name=name)


class Bevel(LineRows):
    """Wheels of a and b about axes that meet, an axis of each (3,), do not slip on each other.

    The row is along e = k_a x k_b/|.|, perpendicular to both axes, through the point of the pitch cones' common line at
    distances r_a and r_b from them: (p - p_a) . (e x k_a) = r_a, (p - p_b) . (k_b x e) = r_b. Hence r_a w_a + r_b w_b =
    0 relative to the carrier of both axes, wherever on these axes the frames are, and the multiplier is the tangential
    force in N.
    """

    m = 1

    def __init__(self, a: Array, b: Array, radii: tuple[float, float]) -> None:
        self.a, self.b, self.radii = a[:, None], b[:, None], radii

    def core_data(self) -> list[dict[str, Any]]:
        a, b = self.a[:, 0].tolist(), self.b[:, 0].tolist()
        return [{"kind": "bevel", "a": a, "b": b, "length": self.radii[0], "other_length": self.radii[1]}]

    def lines(self, pair: Pair) -> Lines:
        ka, kb = pair.Ra.dot(self.a), pair.Rb.dot(self.b)
        dka, dkb = rotated(pair.Va, ka), rotated(pair.Vb, kb)
        across = cross(ka, kb)
        if not np.sqrt((across * across).sum()).real > PARALLEL:
            raise StepError("singular", "its axes are parallel: kind 'gear' is for those")
        e, de = unit(across, cross(dka, kb) + cross(ka, dkb))
        n = np.hstack([cross(e, ka), cross(kb, e), e])
        dn = np.hstack([cross(de, ka) + cross(e, dka), cross(dkb, e) + cross(kb, de), de])
        at, va = np.column_stack([pair.pa, pair.pb, pair.pa]), displaced(pair.Va, pair.pa)
        speed = np.hstack([va, displaced(pair.Vb, pair.pb), va])
        p = np.linalg.solve(n.T, (n * at).sum(axis=0) + np.array([*self.radii, 0.0]))
        dp = np.linalg.solve(n.T, (dn * (at - p[:, None]) + n * speed).sum(axis=0))
        return Lines(e, p[:, None], de, dp[:, None])
