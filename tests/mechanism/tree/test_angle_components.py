"""Which coordinates are angles: after a full turn of them, and of no others, the body is back."""

import numpy as np
import pinocchio as pin
import pytest

from mbdae.mechanism.tree.joints import angle_components


def composite(*joints):
    """Joints in a chain, each 0.3 m off the one before."""
    out = pin.JointModelComposite(len(joints))
    for joint in joints:
        out.addJoint(joint, pin.SE3(np.eye(3), np.array([0.3, 0.1, 0.0])))
    return out


JOINTS = {
    "revolute": pin.JointModelRY(),
    "prismatic": pin.JointModelPX(),
    "helical": pin.JointModelHZ(0.2),
    "universal": pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])),
    "three angles": pin.JointModelSphericalZYX(),
    "two hinges": composite(pin.JointModelRX(), pin.JointModelRZ()),
    "three hinges": composite(pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()),
    "slides and hinge": composite(pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ(), pin.JointModelRX()),
}


@pytest.mark.parametrize("joint", JOINTS.values(), ids=JOINTS.keys())
def test_a_full_turn_of_an_angle_returns_the_body(joint):
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "joint")
    data, q = model.createData(), np.random.default_rng(0).uniform(-1, 1, model.nq)

    def place(x):
        pin.forwardKinematics(model, data, x)
        return data.oMi[1].homogeneous

    before = place(q)
    returned = [np.allclose(place(q + turn), before, atol=1e-12) for turn in 2 * np.pi * np.eye(model.nv)]
    assert angle_components(model).tolist() == returned
