"""Plane curves of bodies, from closures: discs of cams, walls of slots."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .shapes import mesh
from .stick_figure import LINK_COLOURS, Part, coloured


class Outline(NamedTuple):
    """A curve that is fixed to a body.

    Attributes:
        name: name of the closure.
        joint: joint that carries it.
        placement: of the frame in whose x-y plane it lies.
        points: along it [m], (n, 2).
        closed: whether the curve is closed.
        filled: whether it bounds a disc that is star-shaped about its middle.
    """

    name: str
    joint: int
    placement: pin.SE3
    points: np.ndarray
    closed: bool
    filled: bool


def draw_outlines(outlines: Iterable[Outline], height: float) -> Iterator[Part]:
    """Draw them as walls, ``height`` m on both sides of the plane, and discs between the walls."""
    for k, outline in enumerate(outlines):
        n = len(outline.points)
        i = np.arange(n if outline.closed else n - 1)
        ahead = (i + 1) % n
        low, high = (np.column_stack([outline.points, np.full(n, z)]) for z in (-height, height))
        points = np.concatenate([low, high])
        faces = [np.column_stack([i, ahead, ahead + n]), np.column_stack([i, ahead + n, i + n])]
        if outline.filled:
            middle = np.append(outline.points.mean(axis=0), 0.0)
            points = np.concatenate([points, [middle - [0, 0, height], middle + [0, 0, height]]])
            faces += [np.column_stack([np.full_like(i, 2 * n), ahead, i])]
            faces += [np.column_stack([np.full_like(i, 2 * n + 1), i + n, ahead + n])]
        shape, colour = mesh(points, np.concatenate(faces)), LINK_COLOURS[k % len(LINK_COLOURS)]
        yield coloured("link", f"{outline.name} profile", outline.joint, outline.placement, shape, colour)
