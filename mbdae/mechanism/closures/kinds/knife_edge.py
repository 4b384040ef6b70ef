"""The knife_edge closure."""

from typing import Literal

from ....data_types import CoreData
from ....system import Array
from ...tree.frames import Pair
from ..closure import Axis, BetweenFrames
from ..line_rows import LineRows, Lines
from ..rows import axis_rates, point_velocity_column, unit_axis


class KnifeEdgeClosure(BetweenFrames):
    """1 row: b's origin does not slip along the axis of b.

    Attributes:
        axis: direction without slip in the second frame, across the edge.
    """

    kind: Literal["knife_edge"] = "knife_edge"
    axis: Axis
    distinct_frames = True

    def primitives(self) -> "tuple[KnifeEdge]":
        return (KnifeEdge(unit_axis(self.axis)),)

    @classmethod
    def create(cls, a: str, b: str, axis: Axis, name: str = "") -> "KnifeEdgeClosure":
        """The origin of b does not slip against a along an axis of b."""
        return cls(frames=(a, b), axis=axis, name=name)


class KnifeEdge(LineRows):
    """No slip of b's origin against a along an axis of b, (3,)."""

    m = 1

    def __init__(self, axis: Array) -> None:
        self.axis = axis[:, None]

    def core_data(self) -> list[CoreData]:
        return [{"kind": "knife_edge", "b": self.axis[:, 0].tolist()}]

    def lines(self, pair: Pair) -> Lines:
        e = pair.Rb.dot(self.axis)
        return Lines(e, pair.pb[:, None], axis_rates(pair.Vb, e), point_velocity_column(pair.Vb, pair.pb))
