"""Serialized models in saved runs: restored bit for bit, and rejected in one line if a value is wrong."""

import json

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, tree

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism import depth_first
from mbdae.mechanism.model_serialization import CONSTRUCTOR_ARGUMENTS, model_from_data, model_to_data

MODELS = mbdae.model_names()


def same_motion(mech, again):
    """The same trajectory, M and nle, bit for bit."""
    runs = [mbdae.solve(m, (0, 1e-3), method="herk2", step=2.5e-4) for m in (mech, again)]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    np.testing.assert_array_equal(runs[0].lam, runs[1].lam)
    q, v = runs[0].q[-1], runs[0].v[-1] + 0.1
    for law in (lambda m, data: pin.crba(m, data, q), lambda m, data: pin.nle(m, data, q, v)):
        np.testing.assert_array_equal(*(law(m.model, m.model.createData()) for m in (mech, again)))


def every_joint():
    """A tree with every kind of joint, some inside composite ones, and distinct parameters everywhere."""
    kinds, rng = sorted(JOINTS), np.random.default_rng(2)
    model = tree(kinds, list(range(len(kinds))))
    urdf = """<robot name="one"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>
        <child link="b"/><axis xyz="0.3 -0.4 0.7"/></joint></robot>"""
    skewed = pin.buildModelFromXML(urdf).joints[1].extract()
    double = pin.JointModelComposite(pin.JointModelHX(0.2), pin.SE3.Random())
    double.addJoint(pin.JointModelComposite(pin.JointModelRZ()), pin.SE3.Random())
    for name, joint in (("skewed", skewed), ("double", double), ("egg", pin.JointModelEllipsoid(0.1, 0.2, 0.3))):
        j = model.addJoint(model.njoints - 1, joint, pin.SE3.Random(), name)
        model.inertias[j] = pin.Inertia.Random()
    model.armature[:] = rng.uniform(0, 1, model.nv)
    model.damping[:] = rng.uniform(0, 1, model.nv)
    return model


def test_every_kind_of_joint_comes_back_bit_for_bit():
    model = every_joint()
    again = model_from_data(json.loads(json.dumps(model_to_data(model))))
    q = pin.integrate(model, pin.neutral(model), np.linspace(-0.4, 0.5, model.nv))
    v = np.linspace(1, -1, model.nv)
    for law in (lambda m, data: pin.crba(m, data, q), lambda m, data: pin.nle(m, data, q, v)):
        np.testing.assert_array_equal(law(model, model.createData()), law(again, again.createData()))
    assert list(again.frames) == list(model.frames)
    for name in ("damping", "lowerPositionLimit", "upperEffortLimit"):
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    for kind in CONSTRUCTOR_ARGUMENTS:
        assert hasattr(pin, f"JointModel{kind}")


@pytest.mark.parametrize("name", MODELS)
def test_a_saved_mechanism_moves_as_before(name, tmp_path):
    """Both from its files, and from a user model."""
    mech = mbdae.load(name)
    own = mbdae.Mechanism(
        mech.model, mech.closures, mech.forces, drivers=mech.drivers, start=mech.start_values, title="own"
    )
    for m in (mech, own):
        mbdae.solve(m, (0, 1e-3), method="herk2", step=5e-4).save(tmp_path / "run.npz")
        same_motion(m, mbdae.Solution.load(tmp_path / "run.npz").mechanism)


@pytest.mark.parametrize(
    ("where", "value", "said"),
    [
        (("joints", 1, "parent"), 7, "parent joint 7"),
        (("joints", 1, "parent"), -1, "parent"),
        (("joints", 1, "joint", "kind"), "RQ", "joint 'revolute_1' is of unknown kind 'RQ'; known: RX"),
        (("joints", 1, "joint", "numbers"), [1.0], "has 1 parameters; needs 3"),
        (("joints", 1, "joint", "numbers"), [1.0, 1.0, 0.0], "axis of joint 'revolute_1' is not of unit length"),
        (("joints", 1, "joint", "numbers"), [np.nan, 0, 0], "numbers"),
        (("joints", 0, "joint", "parts"), [], "composed of 0 joints"),
        (("joints", 0, "inertia", "mass"), np.inf, "mass"),
        (("joints", 0, "inertia", "mass"), -1.0, "inertia of joint 'composite_0' has a negative mass"),
        (("joints", 0, "inertia", "moments"), [1.0, 0, -1.0, 0, 0, 1.0], "negative mass or moment"),
        (("joints", 0, "place"), [0.0] * 11, "place"),
        (("joints", 0, "place"), [0.0] * 12, "placement of joint 'composite_0' is not a rotation"),
        (("frames", 0, "place"), [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0], "placement of frame 'tip_0' is not a rot"),
        (("joints", 1, "name"), "composite_0", "two joints are called"),
        (("frames", 0, "joint"), 10**6, "do not exist"),
        (("frames", 0, "type"), "JOY", "type"),
        (("frames", 1, "name"), "tip_0", "two frames are called"),
        (("arrays", "armature"), [1.0], "armature needs 9 finite numbers"),
        (("arrays", "damping"), [np.nan] * 9, "damping needs 9 finite numbers"),
        (("arrays",), {}, "needs 9 finite numbers"),
    ],
)
def test_a_wrong_number_is_named(where, value, said):
    data = model_to_data(tree(["composite", "revolute", "spherical"], [0, 1, 2]))
    inner = data
    for key in where[:-1]:
        inner = inner[key]
    inner[where[-1]] = value
    with pytest.raises(InputError, match=said):
        model_from_data(json.loads(json.dumps(data)))


def test_runs_of_earlier_formats_are_rejected_in_one_line(tmp_path):
    model, _ = depth_first(tree(["revolute"], [0]))
    mbdae.solve(mbdae.Mechanism(model), (0, 1e-3), step=5e-4).save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        data = {name: file[name] for name in file.files}
    meta = json.loads(str(data["meta"]))
    meta["format"], meta["mechanism"]["model"] = 1, model.saveToString()
    np.savez(tmp_path / "old.npz", **{**data, "meta": np.array(json.dumps(meta))})
    with pytest.raises(InputError, match=r"old\.npz was written by mbdae .* in format 1; .* reads format 2$"):
        mbdae.Solution.load(tmp_path / "old.npz")
