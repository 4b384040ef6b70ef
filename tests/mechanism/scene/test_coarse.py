"""Coarser triangles keep the shape within a cell of their grid."""

import numpy as np
import pytest

import mbdae
from mbdae.mechanism.scene.coarse import coarse, coarse_surface
from mbdae.mechanism.scene.drawables import drawables, primitive


def area(surface):
    a, b, c = (surface.points[surface.faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


@pytest.mark.parametrize("limit", [1000, 300, 120])
def test_a_sphere_stays_a_sphere(limit):
    (fine,) = primitive("ellipsoid", (1.0, 1.0, 1.0)).surfaces
    fine = fine._replace(points=fine.points / np.linalg.norm(fine.points, axis=1)[:, None])
    found = coarse_surface(fine, limit)
    assert len(found.faces) <= limit < len(fine.faces)
    radius = np.linalg.norm(found.points[np.unique(found.faces)], axis=1)
    assert 0.8 < radius.min() <= radius.max() <= 1 + 1e-6  # means of points of the sphere lie inside
    assert area(found) == pytest.approx(area(fine), rel=0.25)
    edges = np.sort(np.concatenate([found.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed


def test_parts_keep_their_proportions_and_few_triangles_stay():
    parts = drawables(mbdae.load("four_bar").scene)
    assert coarse(parts, 10**6) == parts
    found = coarse(parts, 500)
    count = sum(len(surface.faces) for part in found for surface in part.solid.surfaces)
    assert 100 < count < 1000
    assert [part.name for part in found] == [part.name for part in parts]
