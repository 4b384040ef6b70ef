"""Points of a motion that a camera should show, its extent, and the plane of a planar motion."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...system import Array
from .scene import Scene

FRAMES = 60  # frames of a motion
FLAT = 0.3  # fraction of the widest extent: thinner scenes are shown without perspective along their thinnest axis
FAR = 2.5  # path length, in sizes of a mechanism, above which the camera follows it
MARGIN = 0.2  # fraction of the size of the moving shapes: resting shapes are shown within this margin
CORNERS = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T  # corners of a box
DIRECTION_COUNT = 150  # number of directions on a sphere in which extreme points are kept


class Visible(NamedTuple):
    """Points that a camera should show.

    Attributes:
        points: points (n, 3) in m, relative to the body that the camera follows.
        thin: index of the thinnest axis of a flat scene; -1 if it is not flat.
        extent: diagonal of the box around the points in m.
        moves: whether anything moves.
    """

    points: Array
    thin: int
    extent: float
    moves: bool


def sampled(q: Array, count: int = FRAMES) -> Array:
    """Return at most ``count`` of the configurations of a motion (m, nq), with its first and last."""
    return q[np.unique(np.linspace(0, len(q) - 1, min(len(q), count)).astype(int))]


class VisiblePoints:
    """Points of a motion q (m, nq) of a scene that should be visible, without rails and closure markers."""

    def __init__(self, scene: Scene, q: Array) -> None:
        self.placements = placements = scene.placements(q)
        counted = [k for k, shape in enumerate(scene.shapes) if shape.role not in ("rail", "closure")]
        moving = [k for k in counted if np.ptp(placements[:, k], axis=0).any()]
        ends = scene.end_points(scene.springs, q).reshape(len(q), -1, 6)
        springs = ends[:, np.ptp(ends, axis=0).any(axis=1)].reshape(len(q), -1, 3)
        points = np.concatenate([corners(scene, moving, placements), springs], axis=1)
        many = points.shape[1] > len(DIRECTIONS)  # the extreme points of each configuration suffice
        self.moving = np.array([x[_extreme(x)] for x in points]) if many else points
        self.rest = corners(scene, [k for k in counted if k not in moving], placements[:1])[0]

    def visible(self, followed: int | None = None) -> Visible:
        """Return the points to be shown; without resting shapes if the camera follows a shape, given by its index."""
        origin = 0.0 if followed is None else self.placements[:, followed, None, :3]
        moving = (self.moving - origin).reshape(-1, 3)
        points, moves = moving, len(moving) > 0
        if not moves:
            points = self.rest if len(self.rest) else np.array([[-0.5] * 3, [0.5] * 3])
        elif followed is None:
            margin = MARGIN * np.linalg.norm(np.ptp(moving, axis=0))
            inside = np.clip(self.rest, moving.min(axis=0) - margin, moving.max(axis=0) + margin)
            points = np.concatenate([moving, inside])
        size = np.ptp(points, axis=0)
        thin = int(size.argmin()) if size.min() < FLAT * size.max() else -1
        return Visible(points[np.unique(_extreme(points))], thin, float(np.linalg.norm(size)) or 1.0, moves)


def corners(scene: Scene, shapes: Sequence[int], placements: Array) -> Array:
    """Return the corners (m, 8 n, 3) of the boxes of n shapes, from the placements (m, k, 7) of all k shapes."""
    out = np.empty((len(placements), len(shapes), 8, 3))
    for i, k in enumerate(shapes):
        low, high = scene.shapes[k].bounds
        R = Rotation.from_quat(placements[:, k, 3:]).as_matrix()
        out[:, i] = (low + CORNERS * (high - low)) @ R.swapaxes(1, 2) + placements[:, k, None, :3]
    return out.reshape(len(placements), -1, 3)


def bounds(scene: Scene, q: Array) -> Array:
    """Return the corners (2, 3) of the box around all shapes except closure markers, at configurations q (m, nq)."""
    shown = [k for k, shape in enumerate(scene.shapes) if shape.role != "closure"]
    points = corners(scene, shown, scene.placements(q)).reshape(-1, 3)
    return np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else np.array([[-0.5] * 3, [0.5] * 3])


def _directions() -> Array:
    """Return unit vectors along a golden-angle spiral on the sphere and along the axes, (n, 3)."""
    k = np.arange(DIRECTION_COUNT) + 0.5
    up, angle = 1 - 2 * k / DIRECTION_COUNT, np.pi * (1 + 5**0.5) * k
    side = np.sqrt(1 - up * up)
    return np.concatenate([np.column_stack([side * np.cos(angle), side * np.sin(angle), up]), np.eye(3), -np.eye(3)])


DIRECTIONS = _directions()


def _extreme(points: Array) -> Array:
    """Return the index of the extreme point in each direction."""
    return (DIRECTIONS @ points.T).argmax(axis=1)  # rows are contiguous, columns take ten times as long
