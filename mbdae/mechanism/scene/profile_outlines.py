"""Profiles of cams and slots, drawn on their bodies as discs and walls."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .shapes import mesh
from .stick_figure import LINK_COLOURS, ShapeWithRole, coloured


class Outline(NamedTuple):
    """A curve that is fixed to a body.

    Attributes:
        name: name of the closure.
        joint: joint of the body with the curve.
        placement: placement of the frame whose x-y plane contains the curve.
        points: points of the curve [m], (n, 2).
        closed: whether the curve is closed.
        filled: whether a disc is drawn, which must be star-shaped about its centre.
    """

    name: str
    joint: int
    placement: pin.SE3
    points: np.ndarray
    closed: bool
    filled: bool


def draw_outlines(outlines: Iterable[Outline], height: float) -> Iterator[ShapeWithRole]:
    """Yield curves as walls, ``height`` m on both sides of the plane, with discs between the walls if filled."""
    for k, outline in enumerate(outlines):
        n = len(outline.points)
        i = np.arange(n if outline.closed else n - 1)
        following = (i + 1) % n
        low, high = (np.column_stack([outline.points, np.full(n, z)]) for z in (-height, height))
        points = np.concatenate([low, high])
        faces = [np.column_stack([i, following, following + n]), np.column_stack([i, following + n, i + n])]
        if outline.filled:
            centre = np.append(outline.points.mean(axis=0), 0.0)
            points = np.concatenate([points, [centre - [0, 0, height], centre + [0, 0, height]]])
            faces += [np.column_stack([np.full_like(i, 2 * n), following, i])]
            faces += [np.column_stack([np.full_like(i, 2 * n + 1), i + n, following + n])]
        shape, colour = mesh(points, np.concatenate(faces)), LINK_COLOURS[k % len(LINK_COLOURS)]
        yield coloured("link", f"{outline.name} profile", outline.joint, outline.placement, shape, colour)
