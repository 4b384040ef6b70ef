"""Mesh simplification, for browsers that render without a graphics card."""

import numpy as np

from .drawables import Drawable, Solid
from .surfaces import Surface

CELLS = (64, 48, 32, 24, 16, 12, 8, 6, 4)  # numbers of grid cells along the longest side of a surface


def coarse(drawables: list[Drawable], limit: int) -> list[Drawable]:
    """Return drawables with about ``limit`` triangles in total, distributed in proportion to their triangles.

    Points within a cell of a grid are merged into their mean. Textured and stretching surfaces are not simplified.
    Source: Rossignac, Borrel (1993), Multi-resolution 3D approximations for rendering complex scenes.
    """
    count = sum(len(surface.faces) for x in drawables for surface in x.solid.surfaces)
    ratio = limit / max(count, limit)
    return [x._replace(solid=_coarse_solid(x.solid, ratio)) for x in drawables]


def _coarse_solid(solid: Solid, ratio: float) -> Solid:
    if ratio == 1 or solid.stretch is not None:
        return solid
    return Solid(tuple(coarse_surface(surface, ratio * len(surface.faces)) for surface in solid.surfaces))


def coarse_surface(surface: Surface, limit: float) -> Surface:
    """Return a surface with up to ``limit`` triangles, or the surface on the coarsest grid."""
    low, size = surface.points.min(axis=0), np.ptp(surface.points, axis=0).max()
    for cells in CELLS if surface.uv is None and len(surface.faces) > limit else ():
        cell = np.floor((surface.points - low) / size * cells)
        index = np.unique(cell, axis=0, return_inverse=True)[1].ravel()
        points = np.stack([np.bincount(index, x) for x in surface.points.T], axis=1) / np.bincount(index)[:, None]
        faces = index[surface.faces]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        kept = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
        if len(kept) <= limit or cells == CELLS[-1]:
            return surface._replace(points=points, faces=faces[np.sort(kept)]) if len(kept) else surface
    return surface
