"""The distance closure."""

from typing import Annotated, Literal

from pydantic import Field

from ...key_units import Unit
from ..closure import UnilateralClosure
from ..rows import Distance


class DistanceClosure(UnilateralClosure):
    """1 row: the distance between the origins is `length` > 0, in m.

    Attributes:
        length: distance in m.
    """

    kind: Literal["distance"] = "distance"
    length: Annotated[float, Unit("m")] = Field(gt=0)
    free_side = -1.0  # a rope is slack at a shorter distance

    def primitives(self) -> tuple[Distance]:
        return (Distance(self.length),)

    @classmethod
    def create(cls, a: str, b: str, length: float, name: str = "") -> "DistanceClosure":
        """Between frames a and b."""
        return cls(frames=(a, b), length=length, name=name)
