"""Random SDF, URDF and MJCF files: poses, accelerations under closures, forces, and unknown elements."""

import copy
import os
import re
import warnings
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest
from mujoco_models import at, mass_matrix
from random_bodies import G, accelerations, random_mechanism
from random_files import to_mjcf, to_sdf, to_urdf, with_unknown_elements

import mbdae

MANY = int(os.environ.get("MBDAE_FILES", "60"))  # of each format
EXACT = 1e-8
FORMATS = {
    "sdf": (to_sdf, ("revolute", "prismatic", "universal", "ball", "fixed", "free"), {}),
    "urdf": (to_urdf, ("revolute", "prismatic", "fixed", "free", "planar"),
             {"springs": False, "loops": False, "weightless": 0.0}),
    "xml": (to_mjcf, ("revolute", "prismatic", "ball", "fixed", "free"), {"weightless": 0.0}),
}  # fmt: skip


def described(kind, seed):
    write, kinds, options = FORMATS[kind]
    of, rng = random_mechanism(seed, kinds, **options), np.random.default_rng(seed)
    if kind == "sdf":
        used = {j.child for j in of.joints if j.kind == "free"}  # a link without a joint is free
        of.joints = [j for j in of.joints if j.child not in used]
    if kind == "xml":  # a ring of ball and revolute joints, closed by a point
        for j in (*of.joints, *of.loops):
            j.kind = "ball" if j.kind == "universal" else j.kind
            j.axes = [] if j.kind == "ball" else j.axes
        for j in of.loops:
            j.kind, j.axes, j.damping, j.stiffness = "ball", [], [], 0.0
    return of, write(of, rng)


def free_velocity(mech, q, rng):
    """A random velocity that the closures allow."""
    G = np.array([mech.residual(q, e)[1] for e in np.eye(mech.nv)]).T.reshape(-1, mech.nv)
    _, s, V = np.linalg.svd(G)
    rank = int((s > 1e-9 * max(1, s[0])).sum()) if len(s) else 0
    return V[rank:].T @ rng.standard_normal(mech.nv - rank)


def motion(mech, q, v, a, of):
    """Pose, twist and acceleration of each body, of its centre and about it, in the world."""
    model, data = mech.model, mech.model.createData()
    pin.forwardKinematics(model, data, q, v, a)
    out = {}
    for n, b in of.bodies.items():
        frame = model.frames[model.getFrameId(n, pin.FrameType.BODY)]
        joint = data.oMi[frame.parentJoint]
        twist, change = (joint.act(x[frame.parentJoint]) for x in (data.v, data.a))
        w, dw = twist.angular, change.angular
        velocity = twist.linear + np.cross(w, b.centre)
        change = change.linear + np.cross(dw, b.centre) + np.cross(w, velocity)
        out[n] = joint * frame.placement, (velocity, w), (change, dw)
    return out


def immobile(of):
    """Whether nothing moves, which is rejected."""
    return all(j.kind == "fixed" for j in of.joints) and len({j.child for j in of.joints}) == len(of.bodies)


def read(kind, content, folder):
    """The mechanism of a file, with the gravity of the bodies, and its warnings."""
    path = folder / f"x.{kind}"
    path.write_text(content)
    if kind == "urdf":  # without gravity in the file
        (folder / "x.toml").write_text(f'gravity = {G.tolist()}\nsource = "x.urdf"')
        path = folder / "x.toml"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mech = mbdae.load(path)
    return mech, [str(w.message) for w in caught]


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORMATS)
def test_random_files_move_like_their_bodies(kind, tmp_path):
    if kind == "xml":
        pytest.importorskip("mujoco", reason="mujoco is not installed")
    for seed in range(MANY):
        of, content = described(kind, seed)
        if immobile(of):
            continue
        mech, said = read(kind, content, tmp_path)
        assert all(re.fullmatch(r"x: not carried over: limits of joints [j\d, ]*( and .*)?", text) for text in said), (
            said
        )
        q, rng = mech.start[0], np.random.default_rng(seed)
        v = free_velocity(mech, q, rng)
        a = np.asarray(mech.system().derivative(0.0, mech.point(q, v))[0])[mech.nv : 2 * mech.nv]
        found = motion(mech, q, v, a, of)
        expected = accelerations(of, {n: x[1] for n, x in found.items()})
        size = max(1.0, *(np.abs(x).max() for pair in expected.values() for x in pair))
        for n, (pose, _, changes) in found.items():
            if kind != "urdf":  # with links at their joints
                np.testing.assert_allclose(pose.rotation, of.bodies[n].R, atol=EXACT, err_msg=f"{seed}")
                np.testing.assert_allclose(pose.translation, of.bodies[n].p, atol=EXACT, err_msg=f"{seed}")
            for ours, theirs in zip(changes, expected[n], strict=True):
                np.testing.assert_allclose(ours, theirs, atol=EXACT * size, err_msg=f"{seed} {n}")


def test_random_mjcf_files_have_the_mass_matrix_and_forces_of_mujoco_anywhere(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    for seed in range(MANY):
        of, content = described("xml", seed)
        if immobile(of):
            continue
        mech, _ = read("xml", content, tmp_path)
        m = mujoco.MjModel.from_xml_string(content)
        m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        d, rng = mujoco.MjData(m), np.random.default_rng(seed)
        q = pin.integrate(mech.model, pin.neutral(mech.model), rng.uniform(-1, 1, mech.nv))
        v, M = rng.standard_normal(mech.nv), np.empty((m.nv, m.nv))
        T, transport = at(mech, m, d, q, v)
        for row, one in zip(M, np.eye(m.nv), strict=True):
            mujoco.mj_mulM(m, d, row, one)
        ours, system = mass_matrix(mech, q), mech.system()
        np.testing.assert_allclose(T.T @ ours @ T, M, rtol=0, atol=EXACT * np.abs(M).max(), err_msg=f"{seed}")
        system.inertia(0.0, q)
        f = T.T @ (np.asarray(system.force(0.0, q, v, np.empty(0))[0]) - ours @ transport)
        theirs = d.qfrc_passive - d.qfrc_bias
        np.testing.assert_allclose(f, theirs, rtol=0, atol=EXACT * max(1, np.abs(theirs).max()), err_msg=f"{seed}")


@pytest.mark.parametrize("kind", ["sdf", "urdf"])
def test_planted_elements_attributes_and_texts_are_named(kind, tmp_path):
    for seed in range(MANY):
        of, content = described(kind, seed)
        content, plants = with_unknown_elements(content, np.random.default_rng(seed))
        if immobile(of):
            continue
        mech, said = read(kind, content, tmp_path)
        steps = {text.partition(" of ")[0].rpartition("/")[2] for text in mech.left_out}
        assert steps >= set(plants), (seed, set(plants) - steps)
        assert all(plant.strip("@") in said[-1] for plant in plants)


@pytest.mark.parametrize(("kind", "tag"), [("sdf", "mass"), ("sdf", "xyz"), ("sdf", "inertial"), ("urdf", "mass"),
                                           ("urdf", "axis"), ("urdf", "inertial"), ("urdf", "origin")])  # fmt: skip
def test_second_copies_of_what_is_read_once_are_named(kind, tag, tmp_path):
    content = described(kind, 1)[1]
    root = ET.fromstring(content)
    above = next(e for e in root.iter() for x in e if x.tag == tag)
    above.append(copy.deepcopy(above.find(tag)))
    mech, _ = read(kind, ET.tostring(root, encoding="unicode"), tmp_path)
    assert any(text.partition(" of ")[0].endswith(f"/{tag}") for text in mech.left_out), mech.left_out
