"""Triangles to be drawn by pages, .glb files, figures and live views: solids, colours, and motions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ...system import Array
from ...tolerances import COINCIDENT, INPUT_DIGITS, TINY
from .meshes import Mesh
from .scene import Scene, Shape, Strut
from .solids import coil, solid
from .surfaces import Surface, normals, surfaces

GREY = (0.7, 0.7, 0.7, 1.0)
SPRING, CYLINDER, ROD = (0.8, 0.22, 0.2, 1.0), (0.33, 0.33, 0.36, 1.0), (0.62, 0.62, 0.65, 1.0)
Style = Literal["body", "ghost", "closure", "mark"]


class Vertices(NamedTuple):
    """Vertices of the triangles of one surface, one for each point and normal.

    Attributes:
        points: (n, 3).
        normals: unit vectors, (n, 3).
        uv: texture coordinates (n, 2), or None.
        stretch: displacements (n, 3) at twice the length, or None.
        corners: indices of the corners of triangles, (3 m,).
    """

    points: Array
    normals: Array
    uv: Array | None
    stretch: Array | None
    corners: Array


@dataclass(frozen=True, eq=False)
class Solid:
    """Triangles that several drawables may share.

    Attributes:
        surfaces: one for each colour or texture.
        stretch: displacements of the points of a single surface at twice its length, (n, 3); None if it is rigid.
    """

    surfaces: tuple[Surface, ...]
    stretch: Array | None = None

    @cached_property
    def vertices(self) -> list[Vertices]:
        """Vertices of each surface; points of sharp edges are duplicated."""
        return [self._vertices(surface) for surface in self.surfaces]

    def _vertices(self, surface: Surface) -> Vertices:
        corner = surface.faces.ravel()
        columns = [surface.points[corner], np.round(normals(surface), 3)]
        columns += [] if surface.uv is None else [surface.uv.reshape(-1, 2)]
        columns += [] if self.stretch is None else [self.stretch[corner]]
        table = np.hstack(columns).astype("<f4") + np.float32(0)
        rows, index = np.unique(table.view(f"V{table.itemsize * table.shape[1]}"), return_inverse=True)
        rows = rows.view("<f4").reshape(-1, table.shape[1])
        order = np.full(len(rows), len(index))  # vertices in the order of use compress better
        np.minimum.at(order, index.ravel(), np.arange(len(index)))
        order = order.argsort()
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        rows = rows[order]
        points, directions, *more = np.split(rows, np.cumsum([c.shape[1] for c in columns])[:-1], axis=1)
        directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        uv = more.pop(0) if surface.uv is not None else None
        return Vertices(points, directions, uv, more[0] if more else None, rank[index.ravel()])


class Drawable(NamedTuple):
    """Triangles that move rigidly, or stretch along z.

    Attributes:
        name: unique, with the role first: ``"link/rod"``.
        solid: its triangles.
        scale: factors to metres, (3,).
        rgba: colour in [0, 1]; None for the colours of the surfaces.
        style: ``"body"``; ``"ghost"``, translucent; ``"closure"`` and ``"mark"``, drawn on top, a mark without shading.
    """

    name: str
    solid: Solid
    scale: Sequence[float] = (1.0, 1.0, 1.0)
    rgba: tuple[float, ...] | None = None
    style: Style = "body"


class Track(NamedTuple):
    """Values (m, k) over time: for each frame of a motion, or at times (m,) in s from its start.

    Values are interpolated linearly, rotations along great circles, or piecewise constant if ``stepped``.
    """

    values: Array
    times: Array | None = None
    stepped: bool = False

    @property
    def moves(self) -> bool:
        """Whether it is not constant."""
        return bool(np.ptp(self.values, axis=0).any())


Motion = dict[str, Track]  # position (3) in m, rotation (4, quaternion x, y, z, w), scale (3), stretch (1), visible (1)


def drawables(scene: Scene) -> list[Drawable]:
    """Return the drawables of a scene: its shapes, and coils and tubes of springs, which must have known lengths."""
    return [*map(_drawable, scene.shapes), *(x for s in scene.springs for x in _spring_drawables(s, scene.width))]


def motions(scene: Scene, q: Array) -> list[Motion]:
    """Return the motion of each drawable at configurations q (m, nq)."""
    placements = scene.placements(q).swapaxes(0, 1)
    ends = scene.end_points(scene.springs, q).swapaxes(0, 1)
    out = [{"position": Track(p[:, :3]), "rotation": Track(with_continuous_signs(p[:, 3:]))} for p in placements]
    return [*out, *(m for s, e in zip(scene.springs, ends, strict=True) for m in _spring_motions(s, e))]


def _drawable(shape: Shape) -> Drawable:
    style: Style = "closure" if shape.role == "closure" else "body"
    name = f"{shape.role}/{shape.name.replace('/', '|')}"
    if shape.mesh is not None:
        return Drawable(name, _solid_of(shape.mesh), shape.scale, shape.rgba, style)
    if shape.kind == "capsule":
        return Drawable(name, primitive("capsule", tuple(map(float, shape.size))), (1.0, 1.0, 1.0), shape.rgba, style)
    if shape.kind in ("cylinder", "cone"):
        (radius, length) = shape.size
        return Drawable(name, primitive(shape.kind, (1.0, 1.0)), (radius, radius, length), shape.rgba, style)
    scale = shape.size * 3 if shape.kind == "sphere" else shape.size
    kind = "box" if shape.kind == "box" else "ellipsoid"
    return Drawable(name, primitive(kind, (1.0, 1.0, 1.0)), scale, shape.rgba, style)


_MESHES: WeakKeyDictionary[Mesh, Solid] = WeakKeyDictionary()
_PRIMITIVES: dict[tuple[str, tuple[float, ...]], Solid] = {}


def _solid_of(mesh: Mesh) -> Solid:
    if mesh not in _MESHES:
        _MESHES[mesh] = Solid(tuple(surfaces(mesh) or ()))
    return _MESHES[mesh]


def primitive(kind: str, size: tuple[float, ...]) -> Solid:
    """Return a primitive shape; equal sizes share one object."""
    return _PRIMITIVES.setdefault((kind, size), Solid((solid(kind, size),)))


def _spring_drawables(spring: Strut, width: float) -> Iterator[Drawable]:
    """Yield the coil of a spring, and cylinder and rod of a damper, of unit length."""
    radius, name = min(2.4 * width, 0.1 * spring.length), f"spring/{spring.name.replace('/', '|')}"
    if spring.coil:
        surface, stretch = coil(radius, min(0.5 * width, 0.22 * radius), spring.length)
        yield Drawable(f"{name} coil", Solid((surface,), stretch), rgba=SPRING)
    if spring.tube:
        outer = (0.5 if spring.coil else 0.8) * radius
        yield Drawable(f"{name} tube", primitive("cylinder", (1.0, 1.0)), (outer, outer, 1.0), CYLINDER)
        yield Drawable(f"{name} rod", primitive("cylinder", (1.0, 1.0)), (0.5 * outer, 0.5 * outer, 1.0), ROD)


def _spring_motions(spring: Strut, ends: Array) -> Iterator[Motion]:
    """Yield the motions of the drawables of a spring between its ends (m, 2, 3)."""
    first, lines = ends[:, 0], ends[:, 1] - ends[:, 0]
    lengths, rotation = np.linalg.norm(lines, axis=1), Track(aligned_quaternions(lines))
    if spring.coil:
        yield {
            "position": Track(first),
            "rotation": rotation,
            "stretch": Track((lengths / spring.length - 1)[:, None]),
        }
    if spring.tube:
        body = np.minimum(0.5 * spring.length, 0.8 * lengths)
        unit = lines / np.maximum(lengths, TINY)[:, None]
        for low, high in ((0 * body, body), (0.9 * body, lengths)):
            yield {
                "position": Track(first + unit * ((low + high) / 2)[:, None]),
                "rotation": rotation,
                "scale": Track(stretch_scales(np.maximum(high - low, INPUT_DIGITS * spring.length))),
            }


def stretch_scales(z: Array) -> Array:
    """Return scales (m, 3) that stretch along z only."""
    return np.column_stack([np.ones_like(z), np.ones_like(z), z])


def aligned_quaternions(directions: Array) -> Array:
    """Return quaternions (m, 4) that rotate z into directions (m, 3)."""
    d = directions / np.maximum(np.linalg.norm(directions, axis=1), TINY)[:, None]
    out = np.column_stack([-d[:, 1], d[:, 0], np.zeros(len(d)), 1 + d[:, 2]])
    out[1 + d[:, 2] < COINCIDENT] = 1, 0, 0, 0
    return with_continuous_signs(out / np.linalg.norm(out, axis=1)[:, None])


def with_continuous_signs(quaternions: Array) -> Array:
    """Return unit quaternions (m, 4) with signs such that successive quaternions are close."""
    dots = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1])
    signs = np.cumprod(np.concatenate([[1.0], np.where(dots < 0, -1.0, 1.0)]))
    return quaternions * signs[:, None]
