"""Rolling bodies are drawn in contact as their closures require, and rotate with their joints."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae


def lowest(scene, name, place):
    """The lowest point of a shape's triangles, in the world."""
    k = next(k for k, shape in enumerate(scene.shapes) if shape.name == name)
    pose = pin.XYZQUATToSE3(scene.placements(place)[k])
    points = np.asarray(scene.shapes[k].mesh.vertices)
    return min((pose.act(p) for p in points), key=lambda p: p[2])


@pytest.mark.parametrize(("wheel", "radius"), [("rear_wheel", 0.3), ("front_wheel", 0.35)])
def test_a_wheel_touches_its_plane(wheel, radius):
    mech = mbdae.load("bicycle")
    for q in (mech.start[0], mech.assemble(q={"fork": 0.3})[0]):
        assert abs(lowest(mech.scene, f"{wheel} tyre", q)[2]) < 0.01 * radius  # a polygon of 48 corners
    first, second = (spoke(mech, wheel, {wheel: x}) for x in (0.0, 0.4))
    turned = np.arccos(first @ second / np.linalg.norm(first) ** 2)
    assert turned == pytest.approx(0.4, abs=1e-9)


def spoke(mech, wheel, q):
    """From the hub to the middle of the first spoke."""
    names = [shape.name for shape in mech.scene.shapes]
    poses = mech.scene.placements(mech.assemble(q=q)[0])
    return poses[names.index(f"{wheel} spoke"), :3] - poses[names.index(f"{wheel} hub"), :3]


def test_balls_and_ellipsoids_have_their_sizes():
    shapes = {s.name: s for s in mbdae.load("ball_on_turntable").scene.shapes}
    closure = mbdae.load("ball_on_turntable").closures[-1]
    assert shapes["contact"].size == (closure.radius,)
    stone = mbdae.load("rattleback")
    assert stone.scene.shapes[0].size == pytest.approx(stone.closures[0].semi_axes)


def test_closures_of_frames_apart_are_not_marked():
    for name in ("bicycle", "differential_drive", "planetary_gear", "cam_follower"):
        assert not [s.name for s in mbdae.load(name).scene.shapes if s.role == "closure"]


def test_a_cam_is_a_disc_with_its_profile_as_edge():
    mech = mbdae.load("cam_follower")
    shapes = {s.name: s for s in mech.scene.shapes}
    disc = np.asarray(shapes["cam contact profile"].mesh.vertices)
    edge = disc[:-2, :2]
    assert np.linalg.norm(edge - [0.01, 0.0], axis=1) == pytest.approx(0.04)
    assert disc[-2:, :2] == pytest.approx(np.array([[0.01, 0.0]] * 2))
    assert shapes["cam contact"].size == (mech.closures[0].radius,)
