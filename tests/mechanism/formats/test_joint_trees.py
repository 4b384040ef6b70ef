"""Trees of joints copied joint by joint: numbered depth first, locked, attached to each other."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_placement, random_q, tree

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism import depth_first
from mbdae.mechanism.formats.joint_tree import Tree
from mbdae.mechanism.tree.joints import PER_COORDINATE, PER_VELOCITY, is_depth_first


def mass_matrix(model, q):
    M = pin.crba(model, model.createData(), q)
    return np.triu(M) + np.triu(M, 1).T


def columns(model, names, *, of_v):
    """Indices of the coordinates of joints, in the order of names."""
    joints = [model.joints[model.getJointId(n)] for n in names]
    return np.concatenate(
        [np.arange(j.idx_v, j.idx_v + j.nv) if of_v else np.arange(j.idx_q, j.idx_q + j.nq) for j in joints]
    )


def wild_tree(seed):
    """A tree of all kinds of joints in no particular order, with distinct parameters everywhere, and visuals."""
    rng = np.random.default_rng(seed)
    kinds = list(rng.permutation(list(JOINTS)))
    parents = [int(rng.integers(0, i + 1)) for i in range(len(kinds))]
    parents[1:4] = [0, 1, 2]
    model, visuals = tree(kinds, parents, seed), pin.GeometryModel()
    for name in PER_VELOCITY:
        getattr(model, name)[:] = rng.uniform(0, 1, model.nv)
    for name in PER_COORDINATE:
        getattr(model, name)[:] = rng.uniform(0, 1, model.nq)
    for i in range(model.njoints):
        place = random_placement(rng)
        visuals.addGeometryObject(pin.GeometryObject(f"shape_{i}", i, place, coal.Sphere(0.1)))
    return model, visuals, rng


def same_places(visuals, data, other, other_data):
    """The same shapes have the same placements in the world."""
    for a, b in zip(visuals.geometryObjects, other.geometryObjects, strict=True):
        here, there = (d.oMi[g.parentJoint] * g.placement for d, g in ((data, a), (other_data, b)))
        np.testing.assert_allclose(there.homogeneous, here.homogeneous, atol=1e-12)
        assert a.name == b.name


@pytest.mark.parametrize("seed", range(6))
def test_a_renumbered_tree_is_the_same_tree(seed):
    model, visuals, rng = wild_tree(seed)
    assert not is_depth_first(model)
    new, shapes = depth_first(model, visuals)
    assert is_depth_first(new)
    names = list(new.names)[1:]
    assert sorted(names) == sorted(list(model.names)[1:])
    iq, iv = columns(model, names, of_v=False), columns(model, names, of_v=True)
    q, v, a = random_q(model, rng), rng.standard_normal(model.nv), rng.standard_normal(model.nv)
    old, data = model.createData(), new.createData()
    expected = pin.rnea(model, old, q, v, a)[iv]
    np.testing.assert_allclose(pin.rnea(new, data, q[iq], v[iv], a[iv]), expected, atol=1e-12)
    rest = pin.rnea(model, old, q, 0 * v, 0 * v)
    inertial = [pin.rnea(model, old, q, 0 * v, e) - rest for e in np.eye(model.nv)]
    np.testing.assert_allclose(mass_matrix(new, q[iq]), np.array(inertial)[np.ix_(iv, iv)], atol=1e-12)
    for name in PER_VELOCITY:
        np.testing.assert_array_equal(getattr(new, name), np.array(getattr(model, name))[iv])
    for name in PER_COORDINATE:
        np.testing.assert_array_equal(getattr(new, name), np.array(getattr(model, name))[iq])
    pin.framesForwardKinematics(model, old, q)
    pin.framesForwardKinematics(new, data, q[iq])
    for i, f in enumerate(model.frames):
        k = new.getFrameId(f.name, f.type)
        np.testing.assert_allclose(data.oMf[k].homogeneous, old.oMf[i].homogeneous, atol=1e-12)
    same_places(visuals, old, shapes, data)


def test_pinocchio_is_wrong_without_the_right_numbers():
    """The reason: crba assumes that the velocities of a subtree are contiguous."""
    model, _, rng = wild_tree(0)
    q, data = random_q(model, rng), model.createData()
    zero = np.zeros(model.nv)
    rest = pin.rnea(model, data, q, zero, zero)
    inertial = np.array([pin.rnea(model, data, q, zero, e) - rest for e in np.eye(model.nv)])
    assert np.abs(mass_matrix(model, q) - inertial).max() > 1e-2
    with pytest.raises(InputError, match="depth first"):
        mbdae.Mechanism(model)


def test_a_model_in_order_is_left_alone():
    model = tree(["rx", "py", "spherical"], [0, 1, 0])
    assert depth_first(model)[0] is model


def test_locked_joints_become_part_of_what_carries_them():
    model, visuals, rng = wild_tree(1)
    q = random_q(model, rng)
    names = list(model.names)[1:]
    locked = {n: q[columns(model, [n], of_v=False)] for n in names[::3]}
    free = [n for n in names if n not in locked]
    new = Tree().graft(model, visuals, locked=locked)
    new.model.gravity = model.gravity
    order = list(new.model.names)[1:]
    assert sorted(order) == sorted(free)
    iq, iv = columns(model, order, of_v=False), columns(model, order, of_v=True)
    v = np.zeros(model.nv)
    v[iv] = rng.standard_normal(len(iv))
    old, data = model.createData(), new.model.createData()
    expected = pin.nonLinearEffects(model, old, q, v)[iv]
    np.testing.assert_allclose(pin.nonLinearEffects(new.model, data, q[iq], v[iv]), expected, atol=1e-12)
    pin.framesForwardKinematics(new.model, data, q[iq])
    pin.framesForwardKinematics(model, old, q)
    for i, f in enumerate(model.frames):
        k = new.model.getFrameId(f.name)
        np.testing.assert_allclose(data.oMf[k].homogeneous, old.oMf[i].homogeneous, atol=1e-12)
    same_places(visuals, old, new.visuals, data)


def test_a_grafted_tree_hangs_where_it_was_put():
    base, other = tree(["rx", "spherical"], [0, 1], 1), tree(["py", "rx"], [0, 0], 2)
    place = random_placement(np.random.default_rng(3))
    both = Tree().graft(base)
    tip = both.model.frames[both.model.getFrameId("tip_1")]
    both.graft(other, parent=tip, placement=place, prefix="b_")
    assert list(both.model.names) == ["universe", "rx_0", "spherical_1", "b_py_0", "b_rx_1"]
    q1, q2 = random_q(base, np.random.default_rng(4)), np.array([0.3, -0.8])
    data, one, two = both.model.createData(), base.createData(), other.createData()
    pin.framesForwardKinematics(both.model, data, np.concatenate([q1, q2]))
    pin.framesForwardKinematics(base, one, q1)
    pin.framesForwardKinematics(other, two, q2)
    expected = one.oMf[base.getFrameId("tip_1")] * place * two.oMf[other.getFrameId("tip_1")]
    np.testing.assert_allclose(data.oMf[both.model.getFrameId("b_tip_1")].homogeneous, expected.homogeneous, atol=1e-14)
    with pytest.raises(InputError, match="two joints are called 'rx_0': give one source a prefix"):
        both.graft(base)


def test_depth_first_is_that_subtrees_are_consecutive():
    rng, found = np.random.default_rng(0), set()
    for _ in range(200):
        model = pin.Model()
        for j in range(5):
            model.addJoint(int(rng.integers(max(0, j - 1), j + 1)), pin.JointModelRX(), pin.SE3.Identity(), f"{j}")
        subtrees = [list(x) for x in list(model.subtrees)[1:]]
        found.add(is_depth_first(model))
        assert is_depth_first(model) == all(x == list(range(x[0], x[0] + len(x))) for x in subtrees)
    assert found == {False, True}
