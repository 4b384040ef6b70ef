"""The screw closure."""

from math import pi
from typing import Any, Literal

from pydantic import field_validator

from ....system import Array
from ...frames import Pair
from ..closure import Axis, Z
from ..fixed_axes import FixedAxisClosure
from ..line_rows import LineRows, Lines
from ..rows import displaced, rotated, unit_axis


class ScrewClosure(FixedAxisClosure):
    """1 row: b advances along the axis of a by `lead` per turn about it, besides a cylindrical closure.

    The body must rotate about its axis only.

    Attributes:
        lead: in m per turn, positive for a right-handed screw.
    """

    kind: Literal["screw"] = "screw"
    lead: float
    apart = True
    otherwise = "the bodies can turn about other axes than its own: a screw goes with a cylindrical closure"

    @field_validator("lead")
    @classmethod
    def _advances(cls, lead: float) -> float:
        if not lead:
            raise ValueError("lead must not be zero")
        return lead

    def primitives(self) -> "tuple[Screw]":
        return (Screw(unit_axis(self.axis), self.lead / (2 * pi)),)

    def unfit(self, pair: Pair, relative: Array) -> str:
        angle = self.tilt(pair, relative)
        return f"it turns about another axis than its own, by {angle:.3g} rad" if angle else ""

    @classmethod
    def of(cls, a: str, b: str, lead: float, axis: Axis = Z, name: str = "") -> "ScrewClosure":
        """Frame b advances along an axis of a by ``lead`` metres per turn."""
        return cls(frames=(a, b), lead=lead, axis=axis, name=name)


class Screw(LineRows):
    """b advances along an axis of a, (3,), by ``lead`` in m per radian of its turn about it."""

    m = 1

    def __init__(self, axis: Array, lead: float) -> None:
        self.axis, self.lead = axis[:, None], lead

    def core_data(self) -> list[dict[str, Any]]:
        return [{"kind": "screw", "a": self.axis[:, 0].tolist(), "length": self.lead}]

    def lines(self, pair: Pair) -> Lines:
        e = pair.Ra.dot(self.axis)
        return Lines(e, pair.pb[:, None], rotated(pair.Va, e), displaced(pair.Vb, pair.pb))
