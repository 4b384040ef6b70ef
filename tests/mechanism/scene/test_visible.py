"""Points that a camera should show: none of the corners of moving shapes lies outside."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.mechanism.scene.visible import VisiblePoints

SPREAD = 0.03  # of the extent: between neighbouring directions in which points are kept


def moving_corners(scene, track):
    """Corners of the boxes of shapes that move, (m, n, 3), by Pinocchio's placements."""
    counted = [k for k, shape in enumerate(scene.shapes) if shape.role not in ("rail", "closure")]
    shapes = [k for k in counted if np.abs(track[:, k] - track[0, k]).max() > 0]
    frames = []
    for poses in track:
        boxes = [np.array(np.meshgrid(*scene.shapes[k].bounds.T)).reshape(3, -1).T for k in shapes]
        frames.append([pin.XYZQUATToSE3(poses[k]) * x for k, box in zip(shapes, boxes, strict=True) for x in box])
    return np.array(frames)


@pytest.mark.parametrize(("name", "few"), [("heavy_top", True), ("stewart_platform", False)])
def test_no_corner_of_a_moving_shape_is_out_of_sight(name, few):
    mech = mbdae.load(name)
    q = mbdae.solve(mech, (0, 0.01), step=0.002).q
    scene = mech.scene
    motion_points, track = VisiblePoints(scene, q), scene.placements(q)
    every = moving_corners(scene, track)
    assert (every.shape[1] < 156) == few  # with more corners than directions, configurations are reduced one by one
    directions = np.random.default_rng(0).standard_normal((40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for leader in (0, len(scene.shapes) // 2, len(scene.shapes) - 1):
        points = (every - track[:, leader, None, :3]).reshape(-1, 3)
        shown = motion_points.visible(leader)
        for end in (np.min, np.max):
            np.testing.assert_allclose(end(shown.points, axis=0), end(points, axis=0), atol=1e-12)
        assert shown.extent == pytest.approx(np.linalg.norm(np.ptp(points, axis=0)), rel=1e-12)
        beyond = (points @ directions.T).max(axis=0) - (shown.points @ directions.T).max(axis=0)
        assert beyond.min() > -1e-12
        assert beyond.max() < SPREAD * shown.extent
