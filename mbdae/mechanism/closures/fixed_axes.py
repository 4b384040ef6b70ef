"""Closures of bodies that rotate about given axes only; other closures and joints must enforce these axes."""

from typing import ClassVar

import numpy as np

from ...system import Array
from ...tolerances import THREE_DIGITS
from ..tree.frames import Pair
from .closure import Axis, BetweenFrames, Z
from .rows import unit_axis


class FixedAxisClosure(BetweenFrames):
    """A closure whose rows assume that the bodies rotate about its axes only.

    Attributes:
        axis: an axis in the first frame.
    """

    axis: Axis = Z

    free_rotation_message: ClassVar[str]
    """Message about bodies that can rotate about other axes."""

    @property
    def has_precondition(self) -> bool:
        return True

    def tilt(self, pair: Pair, relative: Array) -> float:
        """Return the angle in rad between the axis in both frames, 0 if negligible; see `violated_precondition`."""
        k = pair.Ra @ unit_axis(self.axis)
        sine = float(np.linalg.norm(np.cross(k, pair.Rb @ relative @ (pair.Ra.T @ k))))
        return float(np.arcsin(min(1.0, sine))) if sine > THREE_DIGITS else 0.0

    def excluded_axes(self, pair: Pair) -> tuple[Array, str]:
        k = pair.Ra @ unit_axis(self.axis)
        return np.eye(3) - np.outer(k, k), self.free_rotation_message
