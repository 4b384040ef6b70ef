"""Positions of frames at many configurations, by the core and in Python, against Pinocchio's placements of frames."""

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_placement, random_q, tree

from mbdae.errors import UnknownNameError
from mbdae.mechanism.tree import frames


@pytest.fixture(params=["native", "python"])
def core(request, monkeypatch):
    """The paths are computed by the core, without a Python function at each configuration; or without the core."""
    if request.param == "native":
        monkeypatch.setattr(frames, "update_motions", None)
    else:
        monkeypatch.setattr(frames, "load", lambda: None)


def compare(model, names):
    q = np.array([random_q(model, np.random.default_rng(seed), 3.0) for seed in range(5)])
    data, placements = model.createData(), []
    for configuration in q:
        pin.framesForwardKinematics(model, data, configuration)
        placements.append([data.oMf[model.getFrameId(name)].translation.copy() for name in names])
    np.testing.assert_allclose(
        frames.frame_paths(model, names, q), np.swapaxes(placements, 0, 1), rtol=0, atol=1e-13
    )
    last = frames.joint_paths(model, [model.names[-1]], q)[0, -1]
    np.testing.assert_allclose(last, data.oMi[model.njoints - 1].translation, rtol=0, atol=1e-13)


@pytest.mark.parametrize("kind", JOINTS)
def test_paths_of_frames_are_those_of_pinocchio(core, kind):
    compare(tree([kind, "rx", kind], [0, 1, 2]), ["tip_0", "tip_1", "tip_2", "ground"])


def test_paths_on_a_joint_that_no_sweep_of_the_core_knows(core):
    model, rng = tree(["free", "rx"], [0, 1]), np.random.default_rng(7)
    joint = model.addJoint(2, pin.JointModelEllipsoid(0.2, 0.3, 0.4), random_placement(rng), "ellipsoid")
    model.addFrame(pin.Frame("egg", joint, random_placement(rng), pin.FrameType.OP_FRAME))
    compare(model, ["tip_1", "egg"])


def test_a_point_of_a_planar_chain(core):
    model = pin.Model()
    for i in range(2):
        model.addJoint(i, pin.JointModelRUBY(), pin.SE3(np.eye(3), np.array([2.0 * i, 0, 0])), f"joint{i}")
    model.addFrame(pin.Frame("tip", 2, 0, pin.SE3(np.eye(3), np.array([0, 0.5, 3.0])), pin.FrameType.OP_FRAME))
    a, b = np.random.default_rng(1).uniform(-3, 3, (2, 6))
    wide = np.column_stack([np.cos(a), np.sin(a), np.cos(b), np.sin(b), a, b])  # as the points of a run: q is a part
    x, z = 2 * np.cos(a) + 3 * np.sin(a + b), -2 * np.sin(a) + 3 * np.cos(a + b)
    (path,) = frames.frame_paths(model, ["tip"], wide[:, :4])
    np.testing.assert_allclose(path, np.column_stack([x, np.full(6, 0.5), z]), rtol=0, atol=1e-14)


def test_no_frames_and_no_configurations(core):
    model = tree(["rx", "py"], [0, 1])
    assert frames.frame_paths(model, [], np.zeros((4, 2))).shape == (0, 4, 3)
    assert frames.frame_paths(model, ["tip_1"], np.zeros((0, 2))).shape == (1, 0, 3)
    assert frames.frame_paths(pin.Model(), ["world"], np.zeros((2, 0))).tolist() == [[[0.0] * 3] * 2]
    with pytest.raises(UnknownNameError, match="unknown frame 'frame9'"):
        frames.frame_paths(model, ["frame9"], np.zeros((1, 2)))
