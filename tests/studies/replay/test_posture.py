"""A still picture of a mechanism: closer parts cover farther ones, a planar motion has axes in metres."""

from io import BytesIO

import coal
import numpy as np
import pinocchio as pin
import pytest
from PIL import Image
from scenes import motion

import mbdae
from mbdae.mechanism.scene.make_scene import make_scene
from mbdae.studies.replay.figure import posture

RED, BLUE = (0.9, 0.1, 0.1, 1.0), (0.1, 0.1, 0.9, 1.0)


def plates(axis, sign):
    """A small red plate in front of a large blue one, both moved to and fro in their plane."""
    model, visual = pin.Model(), pin.GeometryModel()
    model.addJoint(0, [pin.JointModelPY(), pin.JointModelPX(), pin.JointModelPX()][axis], pin.SE3.Identity(), "slide")
    for name, edge, height, rgba in (("large", 1.0, 0.0, BLUE), ("small", 0.4, 0.1, RED)):
        size, place = np.full(3, edge), np.zeros(3)
        size[axis], place[axis] = 0.02, sign * height
        part = pin.GeometryObject(name, 1, 0, pin.SE3(np.eye(3), place), coal.Box(*size))
        part.meshColor = np.array(rgba)
        visual.addGeometryObject(part)
    return motion(make_scene(model, visual), lambda t: np.array([0.1 * t]))


@pytest.mark.parametrize(("axis", "sign", "labels"), [(0, 1, "yz"), (1, -1, "xz"), (2, 1, "xy")])
def test_what_is_nearer_is_seen_and_axes_are_metres(axis, sign, labels):
    def colours(sol):
        figure = posture(sol)
        (ax,) = figure.axes
        file = BytesIO()
        figure.savefig(file, format="png")
        picture = np.asarray(Image.open(file).convert("RGB"))[::-1]
        at = ax.transData.transform([(0.0, 0.0), (0.4, 0.4), (0.49, -0.49), (0.52, 0.0)]).astype(int)
        redder = [int(r) - int(b) for r, _, b in picture[at[:, 1], at[:, 0]]]
        seen = ["red" if x > 50 else "blue" if x < -50 else "none" for x in redder]
        return seen, [ax.get_xlabel(), ax.get_ylabel()]

    assert colours(plates(axis, sign)) == (["red", "blue", "blue", "none"], [f"${x}$ (m)" for x in labels])
    assert colours(plates(axis, -sign))[0] == ["blue", "blue", "blue", "none"]


def test_a_motion_in_space_is_seen_from_a_corner():
    mech = mbdae.load("stewart_platform")
    (ax,) = posture(mbdae.solve(mech, (0, 0.1), rtol=1e-4)).axes
    assert not ax.axison
