"""Sweeps: results of runs, values and seeds, failures as rows, and invalid input."""

import numpy as np
import pinocchio as pin
import pytest
from closure_kinds import body_and_closure
from scipy.special import ellipk

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.formats.model_library import models_directory
from mbdae.solution.signals import signals

PENDULUM = """
title = "Pendulum"
duration = 1.0
[[body]]
name = "bob"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = 2.0
com = [0.0, 0.0, -1.0]
[[force]]
name = "spring"
kind = "joint_spring"
joint = "bob"
stiffness = 0.0
[start]
q = { bob = 0.5 }
"""
LINKS = {"frame.rod_tip.xyz.0": [0.34, 0.36], "start.v.crank": [5.0, 6.0, 7.0]}
QUICK = {"outputs": ["peak force.wrist pin", "q.slider"], "times": 11, "rtol": 1e-6, "executor": "threads"}


@pytest.fixture
def pendulum(tmp_path):
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM)
    return str(path)


def down(t, q, v):
    return q[0]


# -- what a run computes ---------------------------------------------------------------------------------------------


def test_periods_of_pendulums(pendulum):
    # a quarter of the period from rest at an angle, by the complete elliptic integral of the first kind
    grid = {"body.bob.com.2": [-0.5, -1.0, -2.0], "start.q.bob": [0.1, 1.5, 3.0]}
    event = mbdae.Event(down, terminal=True)
    result = mbdae.sweep(pendulum, grid, 20.0, rtol=1e-11, events=event, executor="threads")
    assert set(result["status"]) == {"event"}
    length, angle = -result["body.bob.com.2"], result["start.q.bob"]
    np.testing.assert_allclose(result["t"], np.sqrt(length / 9.81) * ellipk(np.sin(angle / 2) ** 2), rtol=1e-9)


def test_periods_of_a_spring(pendulum):
    runs = [
        {"force.spring.stiffness": k, "gravity": [0, 0, 0], "body.bob.mass": m} for k, m in ((1, 2), (50.0, 2), (3, 1))
    ]
    event = mbdae.Event(down, terminal=True)
    result = mbdae.sweep(pendulum, runs, 20.0, rtol=1e-11, events=event, executor="threads")
    quarter = np.pi / 2 * np.sqrt(result["body.bob.mass"] / result["force.spring.stiffness"])
    np.testing.assert_allclose(result["t"], quarter, rtol=1e-9)


def test_the_tension_of_the_string_of_a_pendulum_is_three_weights():
    # from horizontal rest, whatever its length; one sixth of that on the moon
    grid = {"gravity.2": [-9.81, -9.81 / 6], "body.ball.mass": [1.0, 3.0]}
    result = mbdae.sweep("pendulum", grid, 1.6, outputs=["peak force.string"], executor="threads", max_step=4e-3)
    weight = -result["gravity.2"] * result["body.ball.mass"]
    np.testing.assert_allclose(result["peak force.string"], 3 * weight, rtol=1e-4)


def test_outputs_are_those_of_the_solution():
    mech = mbdae.load("slider_crank")
    times = np.linspace(0, 1, 41)
    names = ["final q.slider", "max v.crank", "min energy", "mean t", "peak torque.wrist pin"]
    names += ["q.crank", "lam.wrist pin.1", "force.wrist pin"]
    result = mbdae.sweep("slider_crank", [{}], 1.0, outputs=names, times=41, rtol=1e-8, executor="threads")
    sol = mbdae.solve(mech, (0, 1), rtol=1e-8, t_eval=times)
    signals, reaction = sol.signals(), sol.reaction("wrist pin")
    assert result["final q.slider"][0] == signals["q.slider"][-1]
    found = sol.statistics(["v.crank", "energy"])
    assert result["max v.crank"][0] == pytest.approx(found.maximum["v.crank"].value, rel=1e-14)
    assert found.maximum["v.crank"].value >= signals["v.crank"].max()
    assert result["min energy"][0] == pytest.approx(found.minimum["energy"].value, rel=1e-14)
    assert result["mean t"][0] == pytest.approx(0.5, abs=1e-12)
    assert result["peak torque.wrist pin"][0] == pytest.approx(np.linalg.norm(reaction.torque, axis=1).max(), abs=1e-9)
    np.testing.assert_array_equal(result["q.crank"], signals["q.crank"][None])
    np.testing.assert_allclose(result["lam.wrist pin.1"], signals["lam.wrist pin.1"][None], rtol=0, atol=1e-10)
    np.testing.assert_allclose(result["force.wrist pin"][0], np.linalg.norm(reaction.force, axis=1), rtol=1e-10)


@pytest.mark.parametrize("kind", ["revolute", "universal", "prismatic", "distance", "in_line"])
def test_forces_of_closures_are_those_of_their_reactions(kind, tmp_path):
    mech = body_and_closure(kind, tmp_path)
    sol = mbdae.solve(mech, (0, 0.1))
    name = mech.closures[0].name
    reaction = sol.reaction(name)
    forces = signals(sol, {f"force.{name}", f"torque.{name}"})
    np.testing.assert_allclose(forces[f"force.{name}"], np.linalg.norm(reaction.force, axis=1), rtol=1e-9)
    moments = np.linalg.norm(reaction.torque, axis=1)  # in N m; zero for some kinds
    np.testing.assert_allclose(forces[f"torque.{name}"], moments, rtol=1e-9, atol=1e-12)
    assert forces[f"force.{name}"].max() > 0.1
    assert (np.abs(sol.lam).max(axis=0) > 1e-3).sum() > (kind != "distance")


def test_joints_of_a_urdf_are_those_of_an_edited_urdf(tmp_path):
    folder = models_directory() / "slider_crank"
    urdf = (folder / "slider_crank.urdf").read_text()
    for old, new in (('"0.1 0 0"', '"0.12 0 0.01"'), ('mass value="0.4"', 'mass value="0.5"')):
        assert urdf.count(old) == 1
        urdf = urdf.replace(old, new)
    (tmp_path / "slider_crank.urdf").write_text(urdf)
    (tmp_path / "mechanism.toml").write_text((folder / "mechanism.toml").read_text())
    edited = mbdae.load(tmp_path).model
    changes = {"joint.crank_pin.xyz.0": 0.12, "joint.crank_pin.xyz.2": 0.01, "joint.crank_pin.mass": 0.5}
    changed = Template("slider_crank").make(changes).model
    assert all(a == b for a, b in zip(changed.inertias, edited.inertias, strict=True))
    assert all(a == b for a, b in zip(changed.jointPlacements, edited.jointPlacements, strict=True))


def test_joints_of_a_source_are_turned():
    """Roll, pitch and yaw one after another, in addition to the rotation in the source."""
    plain, turned = (Template("slider_crank").make(c).model for c in ({}, {"joint.crank_pin.rpy": [0.3, -0.2, 0.5]}))
    at = plain.getJointId("crank_pin")
    roll, pitch, yaw = (pin.exp3(x * e) for x, e in zip((0.3, -0.2, 0.5), np.eye(3), strict=True))
    np.testing.assert_allclose(turned.jointPlacements[at].rotation, yaw @ pitch @ roll, atol=1e-15)
    np.testing.assert_array_equal(turned.jointPlacements[at].translation, plain.jointPlacements[at].translation)
    yawed = Template("slider_crank").make({"joint.crank_pin.rpy.2": 0.5}).model
    np.testing.assert_allclose(yawed.jointPlacements[at].rotation, yaw, atol=1e-15)


def test_runs_that_differ_in_their_start_share_a_mechanism():
    template = Template("slider_crank")
    one, two = (template.make({"start.v.crank": v, "gravity.2": -1.6}) for v in (1.0, 2.0))
    assert one.model is two.model
    assert one.start[1] * 2 == pytest.approx(two.start[1])
    assert one.gravity[2] == -1.6
    assert template.make({"gravity.2": -9.0}).model is not one.model


# -- values and seeds ------------------------------------------------------------------------------------------------


def noisy(gain, seed):
    rng = np.random.default_rng(seed)
    return mbdae.load("slider_crank", forces=[mbdae.JointTorque(joint="crank", torque=gain * rng.normal())])


def last_crank(sol):
    return {"angle": sol.q[-1, 0], "speed": sol.v[-1, 0]}


def test_a_function_gets_values_and_seed():
    runs = {"gain": [0.0, 0.1], "start.v.crank": [6.0], "solve.method": ["herk5", "pherk5"]}
    result = mbdae.sweep(noisy, runs, 0.2, outputs=[last_crank], seed=3, executor="threads", rtol=1e-9)
    assert result.outputs == ["angle", "speed"]
    angle = result["angle"].reshape(2, 2)
    assert abs(angle[0, 0] - angle[0, 1]) < 1e-7  # without a torque the seeds do not matter
    sol = mbdae.solve(noisy(0.1, result["seed"][3]), (0, 0.2), method="pherk5", rtol=1e-9)
    assert angle[1, 1] == sol.q[-1, 0]
    assert result["steps"][0] != result["steps"][1]


# -- what goes wrong -------------------------------------------------------------------------------------------------


def fails_for_two(case: int = 0):
    if case == 2:
        raise ValueError("two is too many")
    return mbdae.load("slider_crank")


def inverse(sol):
    return {"inverse": 1 / float(sol.v[0, 0] - 6.5)}


def test_failed_runs_are_rows():
    runs = [
        {"frame.rod_tip.xyz.0": 0.35, "start.v.crank": 6.5},
        {"frame.rod_tip.xyz.0": 0.001},
        {"joint.slider.mass": -1.0},
        {"solve.max_steps": 3},
        {"solve.rtol": -1.0},
        {"closure.wrist pin.frames.0": "nowhere"},
        {},
    ]
    result = mbdae.sweep("slider_crank", runs, 0.2, outputs=[inverse, "final q.slider"], executor="threads")
    status = list(result["status"])
    assert status == ["output", "assembly", "input", "max_steps", "input", "input", "finished"]
    assert np.isnan(result["final q.slider"][:-1]).all()
    assert np.isfinite(result["final q.slider"][-1])
    assert [row["run"] for row in result.failed] == [0, 1, 2, 3, 4, 5]
    assert "wrist pin" in result.rows[1]["message"]
    assert "joint.slider.mass" in result.rows[2]["message"]
    assert "ZeroDivisionError" in result.rows[0]["message"]
    assert result.rows[3]["t"] < 0.2
    assert "for instance run 1: no consistent configuration" in str(result)
    cases = mbdae.sweep(fails_for_two, {"case": [2, 1]}, 0.1, executor="threads")
    assert list(cases["status"]) == ["error", "finished"]
    assert cases.rows[0]["message"] == "model 'fails_for_two' failed at case = 2: ValueError: two is too many"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["slidr_crank", LINKS], "unknown model 'slidr_crank' (did you mean 'slider_crank'?)"),
        (["slider_crank", {"N": [1]}], "unknown parameter 'N'; valid: duration, gravity, body. ..."),
        (["n_four_bar", {"M": [1]}], "unknown parameter 'M'; valid: N, duration, gravity"),
        (["slider_crank", {"frame.rod.xyz.0": [1]}], "unknown entry of frame 'rod.xyz.0'"),
        (["slider_crank", {"frame.rod_tip.xyz.3": [1]}], "valid: 0, 1, 2"),
        (["slider_crank", {"frame.rod_tip": [1]}], "is a table, name an entry of it: name, parent, xyz, rpy"),
        (["slider_crank", {"joint.crank_pn.xyz.0": [1]}], "did you mean 'crank_pin'"),
        (["slider_crank", {"joint.crank.length": [1]}], "valid: xyz, rpy, mass, com, inertia"),
        (["slider_crank", {"start.q.rod": [1]}], "unknown joint 'rod'"),
        (["slider_crank", {"solve.rtl": [1]}], "did you mean 'rtol'"),
        (["slider_crank", {"solve.method": ["herk9"]}], "unknown method 'herk9'"),
        (["slider_crank", {"duration": [-1.0, -2.0]}], "no mechanism can be constructed from these values"),
        (["slider_crank", {"duration": []}], "duration: a grid takes a list of values"),
        (["slider_crank", {"duration": "long"}], "a grid takes a list of values"),
        (["slider_crank", {"duration": [1.0, "long"]}], "values of one kind"),
        (["slider_crank", {"duration": [None]}], "takes numbers, texts or lists of numbers"),
        (["slider_crank", []], "at least one run"),
        (["slider_crank", 7], "parameters are a grid"),
        (["slider_crank", mbdae.Random(2, {"duration": {"distribution": "norml"}})], "did you mean 'normal'"),
        (["slider_crank", mbdae.Random(2, {"duration": {"distribution": "normal", "mean": 1}})], "does not take"),
        (["slider_crank", mbdae.Random(0, {"duration": 1.0})], "positive number"),
        ([fails_for_two, {"cas": [1]}], "unknown parameter of fails_for_two 'cas' (did you mean 'case'?)"),
        ([fails_for_two, {"case": [2]}], "ValueError: two is too many"),
        ([7, LINKS], "a model is a Mechanism, a name, a path, tables or a function"),
    ],
)
def test_wrong_arguments_are_rejected_before_anything_runs(arguments, words):
    reported = []
    with pytest.raises(InputError) as e:
        mbdae.sweep(*arguments, executor="threads", progress=lambda *x: reported.append(x))
    assert words in str(e.value)
    assert not reported


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"outputs": ["final q.crnk"]}, "did you mean 'q.crank'"),
        ({"outputs": ["maximum q.crank"]}, "(did you mean 'max'?); valid: final, min, max, peak, mean, rms, integral"),
        ({"outputs": ["q.crank"]}, "needs times="),
        ({"outputs": ["final t", "final t"]}, "given twice"),
        ({"outputs": "final t"}, "outputs is a list"),
        ({"outputs": [3]}, "a text or a function"),
        ({"times": 1}, "at least 2"),
        ({"executor": "thread"}, "did you mean 'threads'"),
        ({"executor": 3}, "executor is one of"),
        ({"workers": 0}, "workers is a number of at least 1"),
        ({"seed": -1}, "seed is a whole number"),
        ({"t_span": (1, 1)}, "finite and not empty"),
        ({"path": "runs.csv"}, "ends in .parquet"),
        ({"path": "/nowhere/runs.parquet"}, "cannot write"),
        ({"rtl": 1e-3}, "unknown setting of solve 'rtl'"),
        ({"outputs": [lambda sol: {}], "executor": "processes"}, "cannot be sent to another process"),
    ],
)
def test_wrong_options_are_rejected(options, words):
    with pytest.raises(InputError) as e:
        mbdae.sweep("slider_crank", LINKS, **options)
    assert words in str(e.value)
