"""Closures of bodies that turn about given axes only, which other closures and joints must see to."""

from typing import ClassVar

import numpy as np

from ...system import Array
from ...tolerances import THREE_DIGITS
from ..frames import Pair
from .closure import Axis, BetweenFrames, Z
from .rows import unit_axis


class FixedAxisClosure(BetweenFrames):
    """Its rows assume that the bodies turn about its axes only.

    Attributes:
        axis: in the first frame.
    """

    axis: Axis = Z

    otherwise: ClassVar[str]
    """Message about bodies that can turn about other axes."""

    @property
    def assumes(self) -> bool:
        return True

    def tilt(self, pair: Pair, relative: Array) -> float:
        """Return the angle in rad by which the axis has turned between both frames, 0 if negligible; see `unfit`."""
        k = pair.Ra @ unit_axis(self.axis)
        sine = float(np.linalg.norm(np.cross(k, pair.Rb @ relative @ (pair.Ra.T @ k))))
        return float(np.arcsin(min(1.0, sine))) if sine > THREE_DIGITS else 0.0

    def foreign_axes(self, pair: Pair) -> tuple[Array, str]:
        k = pair.Ra @ unit_axis(self.axis)
        return np.eye(3) - np.outer(k, k), self.otherwise
