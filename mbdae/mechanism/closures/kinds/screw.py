"""The screw closure."""

from math import pi
from typing import Annotated, Literal

from pydantic import field_validator

from ....data_types import CoreData
from ....system import Array
from ...key_units import Unit
from ...tree.frames import Pair
from ..closure import Axis, Z
from ..fixed_axes import FixedAxisClosure
from ..line_rows import LineRows, Lines
from ..rows import axis_rates, point_velocity_column, unit_axis


class ScrewClosure(FixedAxisClosure):
    """1 row: b advances along the axis of a by `lead` per revolution about it, together with a cylindrical closure.

    The body must rotate about this axis only.

    Attributes:
        lead: lead in m per revolution, positive for a right-handed screw.
    """

    kind: Literal["screw"] = "screw"
    lead: Annotated[float, Unit("m")]
    distinct_frames = True
    free_rotation_message = "the bodies can rotate about axes other than the screw axis: add a cylindrical closure"

    @field_validator("lead")
    @classmethod
    def _require_nonzero(cls, lead: float) -> float:
        if not lead:
            raise ValueError("lead must not be zero")
        return lead

    def primitives(self) -> "tuple[Screw]":
        return (Screw(unit_axis(self.axis), self.lead / (2 * pi)),)

    def violated_precondition(self, pair: Pair, relative: Array) -> str:
        angle = self.tilt(pair, relative)
        return f"the body rotates about an axis other than the screw axis, by {angle:.3g} rad" if angle else ""

    @classmethod
    def create(cls, a: str, b: str, lead: float, axis: Axis = Z, name: str = "") -> "ScrewClosure":
        """Frame b advances along an axis of a by ``lead`` metres per revolution."""
        return cls(frames=(a, b), lead=lead, axis=axis, name=name)


class Screw(LineRows):
    """b advances along an axis of a, (3,), by `advance` in m per radian of its rotation about it."""

    m = 1

    def __init__(self, axis: Array, advance: float) -> None:
        self.axis, self.advance = axis[:, None], advance

    def core_data(self) -> list[CoreData]:
        return [{"kind": "screw", "a": self.axis[:, 0].tolist(), "length": self.advance}]

    def lines(self, pair: Pair) -> Lines:
        e = pair.Ra.dot(self.axis)
        return Lines(e, pair.pb[:, None], axis_rates(pair.Va, e), point_velocity_column(pair.Vb, pair.pb))
