"""M, nle, J, inverse dynamics and motions of the core's sweep through the tree, judged by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_placement, random_q, tree

from mbdae import Mechanism, backend

pytestmark = pytest.mark.native


def spatial(data, j, motion):
    return data.oMi[j].act(motion[j]).vector


def expected(model, q, v, a):
    """M, nle, J^T, M a + nle, and velocities and accelerations of joints at the world's origin, by Pinocchio."""
    data = model.createData()
    M = np.triu(pin.crba(model, data, q, pin.Convention.LOCAL))
    M = M + np.triu(M, 1).T
    nle = pin.nonLinearEffects(model, data, q, v).copy()
    full = pin.rnea(model, data, q, v, a).copy()
    J = pin.computeJointJacobians(model, data, q).T.copy()
    pin.forwardKinematics(model, data, q, v, a)
    joints = range(1, model.njoints)
    V, A = (
        np.array([np.zeros(6), *(spatial(data, j, motion) for j in joints)]) for motion in (data.v, data.a)
    )
    return M, nle, J, full, V, A


def compare(model, seed=0, tolerance=1e-13, sweeps=True):
    """Compare at random points, relative to the largest entry."""
    native, rng = backend.load(), np.random.default_rng(seed)
    assert native.sweeps(model) is sweeps
    core = Mechanism(model).system(native=native).core
    for _ in range(3):
        point = random_q(model, rng), rng.uniform(-2, 2, model.nv), rng.uniform(-3, 3, model.nv)
        names = ("M", "nle", "J", "M a + nle", "V", "A")
        for name, found, known in zip(names, core.dynamics(*point), expected(model, *point), strict=True):
            scale = np.abs(known).max(initial=1e-3)
            np.testing.assert_allclose(found, known, rtol=0, atol=tolerance * scale, err_msg=name)


@pytest.mark.parametrize("kind", JOINTS)
def test_each_kind_of_joint(kind):
    compare(tree([kind, "rx", kind, kind, "revolute"], [0, 1, 2, 2, 0], seed=4))


@pytest.mark.parametrize("seed", range(60))
def test_random_trees(seed):
    rng = np.random.default_rng(seed)
    n = rng.integers(2, 12)
    parents, path = [], [0]  # depth first
    for i in range(n):
        path = path[: rng.integers(len(path)) + 1]
        parents.append(path[-1])
        path.append(i + 1)
    model = tree(rng.choice(list(JOINTS), n), parents, seed)
    model.armature = rng.uniform(0, 0.5, model.nv)
    compare(model, seed)


def test_far_from_the_origin():
    model = tree(["revolute", "rx", "spherical", "py", "revolute"], [0, 1, 2, 1, 0], seed=2)
    for j in (1, 5):
        model.jointPlacements[j].translation += np.array([2e4, -1e4, 3e4])
    compare(model)


def test_parameters_changed_in_place():
    model = tree(["revolute", "rx", "py"], [0, 1, 2], seed=1)
    core = Mechanism(model).system(native=backend.load()).core
    rng = np.random.default_rng(3)
    model.inertias[2] = pin.Inertia(3.0, np.array([0.1, 0.2, -0.3]), np.diag([1.0, 2.0, 2.5]))
    model.jointPlacements[2] = random_placement(rng)
    model.gravity.linear = np.array([1.0, 2.0, 3.0])
    model.armature = np.array([0.1, 0.2, 0.3])
    point = rng.uniform(-1, 1, (3, 3))
    for found, known in zip(core.dynamics(*point), expected(model, *point), strict=True):
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-13 * np.abs(known).max())


def test_a_joint_that_only_pinocchio_knows():
    model = tree(["revolute", "rx"], [0, 1], seed=6)
    model.addJoint(2, pin.JointModelEllipsoid(0.2, 0.3, 0.4), random_placement(np.random.default_rng(7)), "ellipsoid")
    compare(model, sweeps=False)
