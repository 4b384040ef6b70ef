"""Every kind of file has an example that runs without drift, and closures move as the joints that they replace."""

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from closure_kinds import KINDS, body_and_closure
from scipy.optimize import least_squares

import mbdae
from mbdae.mechanism.formats.model_library import SOURCES, models_directory

DATA = Path(__file__).parents[2] / "data"
EXCLUDED = ("materials.xml", "loops.xml")  # an included file, and equalities that contradict each other
FILES = sorted(p for p in DATA.rglob("*") if p.suffix in (".toml", *SOURCES) and p.name not in EXCLUDED)


def test_every_kind_has_an_example():
    suffixes = {p.suffix for p in (*FILES, *models_directory().rglob("*"))}
    assert set(SOURCES) <= suffixes


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_every_example_runs_without_drift(path):
    if path.parent.name == "mjcf":
        pytest.importorskip("mujoco", reason="mujoco is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # unsupported contents have separate tests
        mech = mbdae.load(path)
    sol = mbdae.solve(mech, (0, 0.1), rtol=1e-7)
    assert sol.success, sol.message
    found = mbdae.drift(sol)
    assert max(found.g_max, found.energy_relative) < 1e-6
    assert found.Gv_max < 1e-9 * max(1, np.abs(sol.v).max())


def frame(model, name):
    return model.frames[model.getFrameId(name)].placement


def as_tree(mech, kind):
    """The same body on joints instead of the closure: mechanism, start q and v, and the frame in the plug."""
    model, place = pin.Model(), frame(mech.model, "socket")
    joint = 0
    for i, kind_of_joint in enumerate(KINDS[kind].joints):
        if kind == "distance" and i == 2:
            place = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
        joint = model.addJoint(joint, kind_of_joint(), place, f"joint_{i}")
        place = pin.SE3.Identity()
    model.appendBodyToJoint(joint, mech.model.inertias[1], frame(mech.model, "plug").inverse())
    data, (q0, v0) = model.createData(), mech.start
    pose, plug = pin.XYZQUATToSE3(q0), frame(mech.model, "plug")

    def gap(x):
        pin.forwardKinematics(model, data, pin.integrate(model, pin.neutral(model), x))
        return pin.log6((pose * plug).actInv(data.oMi[joint])).vector

    q = pin.integrate(model, pin.neutral(model), least_squares(gap, np.zeros(model.nv), xtol=1e-15, ftol=1e-15).x)
    J = pin.computeJointJacobian(model, data, q, joint).reshape(6, -1)
    twist = plug.actInv(pin.Motion(v0)).vector
    v = np.linalg.lstsq(J, twist, rcond=None)[0]
    np.testing.assert_allclose(J @ v, twist, atol=1e-8)
    return mbdae.Mechanism(model), q, v, plug.inverse()


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.joints])
def test_a_closure_moves_like_the_joint_that_it_replaces(kind, tmp_path):
    mech = body_and_closure(kind, tmp_path)
    tree, q, v, back = as_tree(mech, kind)
    assert mech.nv - mech.ng == tree.nv
    expected = mbdae.solve(tree, (0, 0.5), q, v, rtol=1e-10).q[-1]
    data = tree.model.createData()
    pin.forwardKinematics(tree.model, data, expected)
    sol = mbdae.solve(mech, (0, 0.5), rtol=1e-10)
    pose = pin.XYZQUATToSE3(sol.q[-1])
    np.testing.assert_allclose(pose.homogeneous, (data.oMi[-1] * back).homogeneous, atol=2e-8)
    assert np.abs(sol.q[-1] - sol.q[0]).max() > 0.05


def test_a_weld_holds_and_a_rack_turns_its_wheel(tmp_path):
    weld = body_and_closure("frame", tmp_path)
    sol = mbdae.solve(weld, (0, 0.5), rtol=1e-8)
    np.testing.assert_allclose(sol.q[-1], weld.start[0], atol=1e-12)
    rack = mbdae.load(DATA / "rack.toml")
    sol = mbdae.solve(rack, (0, 0.5), rtol=1e-8)
    angle = 0.5 * 2.0 * 9.81 * 0.1 / (0.02 + 2.0 * 0.1**2) * 0.5**2  # m g r t^2/2 / (I + m r^2)
    np.testing.assert_allclose(sol.q[-1], [angle, 0.05 - 0.1 * angle], atol=1e-9)
