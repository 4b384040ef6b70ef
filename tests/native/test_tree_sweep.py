"""M, nle, J, inverse dynamics and motions of the core's sweep through the tree, judged by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_inertia, random_placement, random_q, tree, unit

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


def compare(model, seed=0, tolerance=1e-13, sweeps=True, planar=False):
    """Compare at random points, relative to the largest entry."""
    native, rng = backend.load(), np.random.default_rng(seed)
    assert native.sweeps(model) is sweeps
    core = Mechanism(model).system(native=native).core
    assert core.planar is planar
    for _ in range(3):
        point = random_q(model, rng), rng.uniform(-2, 2, model.nv), rng.uniform(-3, 3, model.nv)
        names = ("M", "nle", "J", "M a + nle", "V", "A")
        for name, found, known in zip(names, core.dynamics(*point), expected(model, *point), strict=True):
            scale = np.abs(known).max(initial=1e-3)
            np.testing.assert_allclose(found, known, rtol=0, atol=tolerance * scale, err_msg=name)


def depth_first(n, rng):
    """Random parents of n joints."""
    parents, path = [], [0]
    for i in range(n):
        path = path[: rng.integers(len(path)) + 1]
        parents.append(path[-1])
        path.append(i + 1)
    return parents


@pytest.mark.parametrize("kind", JOINTS)
def test_each_kind_of_joint(kind):
    compare(tree([kind, "rx", kind, kind, "revolute"], [0, 1, 2, 2, 0], seed=4))


@pytest.mark.parametrize("seed", range(60))
def test_random_trees(seed):
    rng = np.random.default_rng(seed)
    n = rng.integers(2, 12)
    parents = depth_first(n, rng)
    model = tree(rng.choice(list(JOINTS), n), parents, seed)
    model.armature = rng.uniform(0, 0.5, model.nv)
    compare(model, seed)


def planar_tree(normal, seed, n=8):
    """A tree that moves across a normal, whose joints and bodies have any placement out of the plane."""
    rng = np.random.default_rng(seed)
    basis = np.linalg.svd(normal[None])[2].T  # the last two columns span the plane
    model = pin.Model()
    model.gravity.linear = np.array([0.7, -1.1, -9.81])
    zero = [np.eye(3)]  # rotations of joints at zero angles
    for i, parent in enumerate(depth_first(n, rng)):
        kind = rng.choice(["turn", "slide", "planar", "chain"])
        placement = random_placement(rng)
        if kind == "planar":  # its z along the normal
            frame = np.column_stack([basis[:, 1], np.cross(normal, basis[:, 1]), normal]) * rng.choice([1, -1])
            frame[:, 0] *= np.linalg.det(frame)
            placement.rotation = zero[parent].T @ frame
            joint = pin.JointModelPlanar()
        zero.append(zero[parent] @ placement.rotation)
        axis = zero[-1].T @ normal * rng.choice([1, -1])
        across = zero[-1].T @ basis[:, 1:] @ unit(rng)[:2]
        across /= np.linalg.norm(across)
        if kind in ("turn", "chain"):
            joint = pin.JointModelRevoluteUnaligned(axis)
        elif kind == "slide":
            joint = pin.JointModelPrismaticUnaligned(across)
        if kind == "chain":
            both = pin.JointModelComposite(joint)
            both.addJoint(pin.JointModelPrismaticUnaligned(across), pin.SE3(np.eye(3), rng.uniform(-1, 1, 3)))
            joint = both
        model.appendBodyToJoint(
            model.addJoint(parent, joint, placement, f"joint {i}"), random_inertia(rng), pin.SE3.Identity()
        )
    model.armature = rng.uniform(0, 0.5, model.nv)
    return model


@pytest.mark.parametrize("seed", range(40))
def test_planar_trees(seed):
    rng = np.random.default_rng(100 + seed)
    normal = unit(rng) if seed % 2 else rng.choice([1, -1]) * np.eye(3)[rng.integers(3)]
    model = planar_tree(normal, seed)
    turns = any(joint.nv > 1 or "Revolute" in joint.shortname() for joint in list(model.joints)[1:])
    compare(model, seed, planar=turns)


def test_planar_far_from_the_origin():
    model = planar_tree(np.array([0.0, 1.0, 0.0]), 7)
    for j, parent in enumerate(model.parents):
        if j and not parent:
            model.jointPlacements[j].translation += np.array([2e4, -1e4, 3e4])
    compare(model, planar=True)


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


def test_a_plane_left_by_a_change_in_place():
    model = planar_tree(np.array([0.0, 0.0, 1.0]), 3)
    core = Mechanism(model).system(native=backend.load()).core
    rng = np.random.default_rng(3)
    for change in ("centre", "axis"):
        if change == "centre":
            model.inertias[2] = pin.Inertia(3.0, np.array([0.1, 0.2, -0.3]), np.diag([1.0, 2.0, 2.5]))
        else:
            model.jointPlacements[2] = random_placement(rng)
        point = random_q(model, rng), *rng.uniform(-1, 1, (2, model.nv))
        for found, known in zip(core.dynamics(*point), expected(model, *point), strict=True):
            np.testing.assert_allclose(found, known, rtol=0, atol=1e-13 * np.abs(known).max())
        assert core.planar is (change == "centre")


def test_a_joint_that_only_pinocchio_knows():
    model = tree(["revolute", "rx"], [0, 1], seed=6)
    model.addJoint(2, pin.JointModelEllipsoid(0.2, 0.3, 0.4), random_placement(np.random.default_rng(7)), "ellipsoid")
    compare(model, sweeps=False)
