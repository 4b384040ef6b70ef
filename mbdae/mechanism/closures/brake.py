"""A joint locked by dry friction: the row v_i = 0 while it sticks."""

from collections.abc import Sequence
from typing import NamedTuple

from .joint_rows import Ratio


class Brake(NamedTuple):
    """The row v_i = 0 of a joint with dry friction; its multiplier, in N m or N, is the friction torque or force.

    Attributes:
        joint: name of the joint.
        force: name of its friction force.
        kinetic: kinetic friction torque or force, while it slips, in N m or N.
        static: largest friction torque or force while it sticks, in N m or N.
    """

    joint: str
    force: str
    kinetic: float
    static: float
    m: int = 1
    frames: None = None

    @property
    def name(self) -> str:
        """Name of the row."""
        return f"{self.joint} friction"

    @property
    def between(self) -> tuple[str, ...]:
        """Name of the joint."""
        return (self.joint,)

    def primitives(self) -> Sequence[Ratio]:
        """The row."""
        return [Ratio(self.joint, "", "", (0.0,))]
