"""Shapes as triangles; primitives have their axes of symmetry along z and their centre at the origin."""

from typing import TYPE_CHECKING

import numpy as np

from ...mechanism.scene.surfaces import Surface, surfaces, welded
from ...system import Array
from ...tolerances import COINCIDENT

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Shape

AROUND, ACROSS, TURNS = 48, 16, 12


def coloured_surfaces(shape: "Shape") -> list[Surface]:
    """Return the triangles of a shape, an entry for each colour; none for a damaged mesh."""
    if shape.mesh is None:
        return [solid(shape.kind, shape.size)]
    return surfaces(shape.mesh, pictures=True) or []


def solid(kind: str, size: tuple[float, ...]) -> Surface:
    """Return triangles of a box, sphere, ellipsoid, cylinder, cone or capsule; sizes [m] as those of a `Shape`."""
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


def coil(radius: float, wire: float, length: float) -> Surface:
    """Return a wire wound about z, from the origin to (0, 0, length) [m], straight at both ends."""
    radius = min(radius, 0.1 * length)
    s = np.linspace(0, 1, 20 * TURNS + 1)
    winding = np.clip((s - 0.08) / 0.84, 0, 1)
    r = radius * np.clip(2 * TURNS * np.minimum(winding, 1 - winding), 0, 1)
    angle = 2 * np.pi * TURNS * winding
    middle = np.column_stack([r * np.cos(angle), r * np.sin(angle), length * s])
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * s])
    side = np.cross(np.gradient(middle, axis=0), out)
    side /= np.linalg.norm(side, axis=1)[:, None]
    u = np.linspace(0, 2 * np.pi, 9)
    ring = np.cos(u)[None, :, None] * out[:, None] + np.sin(u)[None, :, None] * side[:, None]
    return welded(_quads(middle[:, None] + min(wire, 0.22 * radius) * ring), None)


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
