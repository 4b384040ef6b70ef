"""Triangles of primitive shapes and springs, symmetric about z, with centres of primitives at the origin."""

from functools import cache

import numpy as np

from ...system import Array
from ...tolerances import COINCIDENT
from .surfaces import Surface, welded

AROUND, ACROSS = 48, 16  # segments around an axis, and of a quarter circle
WIRE_CORNERS, WINDING_POINTS = 8, 20  # corners of the section of a wire; points along a winding


@cache
def solid(kind: str, size: tuple[float, ...]) -> Surface:
    """Return triangles of a box, sphere, ellipsoid, cylinder, cone or capsule; sizes [m] as for `Shape`."""
    if kind == "box":
        sides = np.array([_square(k, end) for k in range(3) for end in (-1, 1)]).reshape(-1, 3, 3)
        return welded(sides * np.array(size) / 2, None)
    if kind in ("sphere", "ellipsoid"):
        angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * ACROSS + 1)
        ball = _revolved(np.cos(angle), np.sin(angle))
        return welded(ball * (np.array(size) if kind == "ellipsoid" else size[0]), None)
    radius, length = size
    if kind == "capsule":
        angle = np.concatenate([np.linspace(-np.pi / 2, 0, ACROSS), np.linspace(0, np.pi / 2, ACROSS)])
        shift = np.repeat([-length / 2, length / 2], ACROSS)
        return welded(_revolved(radius * np.cos(angle), radius * np.sin(angle) + shift), None)
    top = 0.0 if kind == "cone" else radius
    return welded(_revolved(np.array([0, radius, top, 0]), np.array([-1, -1, 1, 1]) * length / 2), None)


def coil(radius: float, wire: float, length: float) -> tuple[Surface, Array]:
    """Return a wire wound about z, from the origin to (0, 0, length) [m], straight at both ends, and its stretch.

    The stretch is the displacement of its points (n, 3) when it becomes twice as long; the wire section stays round.
    """
    turns = int(np.clip(round(length / (1.9 * radius)), 6, 16))
    s = np.linspace(0, 1, WINDING_POINTS * turns + 1)
    winding = np.clip((s - 0.08) / 0.84, 0, 1)
    r = radius * np.clip(2 * turns * np.minimum(winding, 1 - winding), 0, 1)
    angle = 2 * np.pi * turns * winding
    middle = np.column_stack([r * np.cos(angle), r * np.sin(angle), length * s])
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * s])
    side = np.cross(np.gradient(middle, axis=0), out)
    side /= np.linalg.norm(side, axis=1)[:, None]
    u = 2 * np.pi * np.arange(WIRE_CORNERS) / WIRE_CORNERS
    ring = np.cos(u)[None, :, None] * out[:, None] + np.sin(u)[None, :, None] * side[:, None]
    i, k = np.meshgrid(np.arange(len(s) - 1), np.arange(WIRE_CORNERS), indexing="ij")
    a, b = WIRE_CORNERS * i + k, WIRE_CORNERS * i + (k + 1) % WIRE_CORNERS
    c, d = a + WIRE_CORNERS, b + WIRE_CORNERS
    faces = np.stack([a, b, c, b, d, c], axis=-1).reshape(-1, 3)
    points = (middle[:, None] + wire * ring).reshape(-1, 3)
    stretch = np.repeat(np.column_stack([0 * s, 0 * s, length * s]), WIRE_CORNERS, axis=0)
    return Surface(points, faces, None), stretch


def _revolved(r: Array, z: Array) -> Array:
    """Return corners (m, 3, 3) of the surface of revolution of a profile (n,) about z."""
    u = 2 * np.pi * (np.arange(AROUND + 1) % AROUND) / AROUND
    r = np.where(r > COINCIDENT * r.max(), r, 0.0)  # poles are points
    return _quads(np.stack([np.outer(r, np.cos(u)), np.outer(r, np.sin(u)), np.outer(z, np.ones_like(u))], axis=2))


def _quads(grid: Array) -> Array:
    """Return corners (m, 3, 3) of the triangles of a grid of points (a, b, 3)."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _square(axis: int, end: int) -> Array:
    """Return corners (2, 3, 3) of a face of the cube from -1 to 1, anticlockwise from outside."""
    u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3] * end
    a, b, c, d = (end * np.eye(3)[axis] + x * u + y * v for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.array([[a, b, c], [a, c, d]])
