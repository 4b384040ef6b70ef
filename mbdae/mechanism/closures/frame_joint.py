"""Closures that constrain gaps and directions between two frames, as joints do."""

from functools import lru_cache
from typing import ClassVar, Self

import numpy as np

from ...system import Array
from .closure import Axis, BetweenFrames, Vector, Z
from .rows import DotProduct1, DotProduct2, FrameRows, unit_axis


class FrameJoint(BetweenFrames):
    """Rows between two frames that make components of p_b - p_a and products of axes vanish.

    Attributes:
        translation: components of p_b - p_a that vanish: ``"all"``, ``"across"`` or ``"along"`` the axis, or none.
        direction: directions that coincide: ``"axis"``, ``"frame"``, or none; ``"perpendicular"``: axes at 90 degrees.
    """

    translation: ClassVar[str] = ""
    direction: ClassVar[str] = ""

    def axes(self) -> tuple[Vector, Vector]:
        """Return the axes in the first and in the second frame."""
        return Z, Z

    def primitives(self) -> tuple[FrameRows, ...]:
        return between_frames(self.translation, self.direction, *self.axes())

    def coinciding_axes(self) -> tuple[Array, Array]:
        if self.direction == "frame":
            return np.eye(3), np.eye(3)
        if self.direction == "axis":
            first, second = (unit_axis(x)[:, None] for x in self.axes())
            return first, second
        return super().coinciding_axes()


class AxisJoint(FrameJoint):
    """A joint with an axis.

    Attributes:
        axis: an axis in the first frame.
    """

    axis: Axis = Z

    def axes(self) -> tuple[Vector, Vector]:
        return self.axis, self.axis

    @classmethod
    def create(cls, a: str, b: str, axis: Axis = Z, name: str = "") -> Self:
        """Between frames a and b, with an axis of a."""
        return cls(frames=(a, b), axis=axis, name=name)


class TwoAxisJoint(AxisJoint):
    """A joint with an axis in each frame.

    Attributes:
        second_axis: the corresponding axis in the second frame; when left out the same components, or x of a
            universal closure.
    """

    second_axis: Axis | None = None

    def axes(self) -> tuple[Vector, Vector]:
        return self.axis, self.second_axis or self.axis

    @classmethod
    def create(cls, a: str, b: str, axis: Axis = Z, name: str = "", *, second_axis: Axis | None = None) -> Self:
        """Between frames a and b, with an axis of a and the corresponding axis of b, by default the same."""
        return cls(frames=(a, b), axis=axis, second_axis=second_axis, name=name)


@lru_cache(maxsize=256)
def between_frames(translation: str, direction: str, axis: Vector, other: Vector) -> tuple[FrameRows, ...]:
    """Return rows between frames; they are immutable, so workspaces share them."""
    first, second = unit_axis(axis), unit_axis(other)
    normals, (x, y, z) = np.linalg.svd(first[None])[2][1:].T, np.eye(3)
    axes_of_translation = {"all": np.eye(3), "across": normals, "along": first[:, None]}
    axes = {
        "axis": (normals, np.column_stack([second, second])),
        "frame": (np.array([x, y, z]).T, np.array([y, z, x]).T),
        "perpendicular": (first[:, None], second[:, None]),
    }
    out: list[FrameRows] = [DotProduct2(axes_of_translation[translation])] if translation else []
    return (*out, DotProduct1(*axes[direction])) if direction else tuple(out)
