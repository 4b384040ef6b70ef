"""Reactions and efforts against Newton and Euler: pin.rnea with the reactions as external forces, and by hand."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, tree
from driven import DRIVEN
from mechanism.closures.test_closure_kinds import CLOSURES, JOINTS, PARENTS
from scipy.integrate import simpson

import mbdae
from mbdae import Closure, Driver, JointTorque, Mechanism
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.assembly import assembly
from mbdae.mechanism.closures import independent_rows as rows
from mbdae.mechanism.model_settings import Start
from mbdae.mechanism.tree.frames import anchor


def acceleration(sol, t, h=1e-3):
    """v' from differences of the dense output, order six."""
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    return sum(w * (sol(t + k * h).v - sol(t - k * h).v) for k, w in weights.items()) / h


def balance(sol, i, frames, efforts):
    """Residual generalized force at step i: inertia and gravity, minus reactions at bodies, minus efforts on joints."""
    model = sol.mechanism.model
    data = model.createData()
    pin.forwardKinematics(model, data, sol.q[i])
    external = [pin.Force.Zero() for _ in range(model.njoints)]
    for name, (first, second) in frames.items():
        r = sol.reaction(name)
        a, b = anchor(model, first), anchor(model, second)
        point = data.oMi[b.joint].act(b.p)
        for end, sign in ((b, 1.0), (a, -1.0)):  # both at the second frame's origin
            moment = r.torque_world[i] + np.cross(point, r.force_world[i])
            world = pin.Force(sign * np.concatenate([r.force_world[i], moment]))
            if end.joint:
                external[end.joint] += data.oMi[end.joint].actInv(world)
    left = pin.rnea(model, data, sol.q[i], sol.v[i], acceleration(sol, sol.t[i]), external)
    for name, joints in efforts.items():
        e = sol.effort(name)
        for joint, effort in zip(joints, (e.effort, e.counter), strict=False):
            left[model.joints[model.getJointId(joint)].idx_v] -= effort[i]
    return left


@pytest.mark.parametrize("kind", CLOSURES)
def test_every_kind_balances_the_bodies(kind, monkeypatch):
    monkeypatch.setattr(assembly, "require_preconditions", lambda mech, q: None)  # arbitrary frames
    rng, closure = np.random.default_rng(11), CLOSURES[kind]
    mech = Mechanism(tree(JOINTS, PARENTS, seed=3), [closure])
    q, v = mech.assemble(random_q(mech.model, rng, 0.7), 0.5 * rng.standard_normal(mech.nv))
    sol = mbdae.solve(mech, (0, 0.1), q, v, method="pherk6", step=0.005)
    frames = {closure.name: closure.frames} if closure.frames else {}
    efforts = {closure.name: closure.joints} if closure.joints else {}
    left = balance(sol, 10, frames, efforts)
    inertial = pin.rnea(mech.model, mech.model.createData(), sol.q[10], sol.v[10], acceleration(sol, sol.t[10]))
    assert np.abs(inertial).max() > 1e-2
    assert np.abs(left).max() < 2e-7 * (1 + np.abs(inertial).max())
    if frames:
        assert all(sol.reaction(closure.name).unique)


@pytest.mark.parametrize("name", DRIVEN)
def test_drivers_balance_the_bodies_and_do_the_work(name):
    mech = DRIVEN[name]()
    sol = mbdae.solve(mech, (0.2, 1.2), method="pherk6", step=1 / 200)
    frames = {c.name: c.frames for c in mech.constraints if c.frames}
    efforts = {d.name: (d.joint,) for d in mech.drivers if d.joint}
    for i in (40, 125):
        assert np.abs(balance(sol, i, frames, efforts)).max() < 1e-5
    power = sum(sol.effort(d.name).power for d in mech.drivers)
    assert simpson(power, x=sol.t) == pytest.approx(sol.work[-1], rel=1e-6, abs=1e-7)


def hung(turn, kind="revolute"):
    """A bar of 2 kg, free except for a closure to the world's frame ``hook`` at one end, 0.4 m from its centre."""
    model = pin.Model()
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "bar")
    model.appendBodyToJoint(body, pin.Inertia.FromBox(2.0, 0.1, 0.1, 0.8), pin.SE3.Identity())
    model.addFrame(pin.Frame("end", body, pin.SE3(np.eye(3), np.array([0, 0, 0.4])), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("hook", 0, pin.SE3(turn, np.zeros(3)), pin.FrameType.OP_FRAME))
    axis = tuple(turn.T @ np.array([0.0, 1.0, 0.0]))
    axes = {"axis": axis, "second_axis": (0.0, 1.0, 0.0)} if kind == "revolute" else {}
    return Mechanism(model, [Closure(kind=kind, frames=("hook", "end"), name="hinge", **axes)])


def test_a_swinging_bar_pulls_with_weight_and_centripetal_force():
    turn, rate = pin.exp3(np.array([0.3, -0.8, 0.5])), 3.0
    mech = hung(turn)
    q = np.array([0, 0, -0.4, 0, 0, 0, 1.0])
    v = np.array([-0.4 * rate, 0, 0, 0, rate, 0.0])
    sol = mbdae.solve(mech, (0, 0.1), *mech.assemble(q, v), rtol=1e-9)
    r = sol.reaction("hinge")
    expected = np.array([0, 0, 2.0 * (9.81 + rate**2 * 0.4)])
    assert r.force_world[0] == pytest.approx(expected, abs=1e-10)
    assert r.force[0] == pytest.approx(turn.T @ expected, abs=1e-10)
    assert r.torque_world[0] == pytest.approx(np.zeros(3), abs=1e-10)
    assert str(r).startswith("reaction of hinge: force up to ")


def test_a_weld_carries_the_weights_moment():
    mech = hung(np.eye(3), "frame")
    q = np.array([-0.4, 0, 0, *pin.Quaternion(pin.exp3(np.array([0, np.pi / 2, 0]))).coeffs()])
    model = mech.model.copy()
    model.frames[model.getFrameId("hook")].placement = pin.SE3(pin.exp3(np.array([0, np.pi / 2, 0])), np.zeros(3))
    mech = Mechanism(model, mech.closures)
    sol = mbdae.solve(mech, (0, 0.1), *mech.assemble(q), rtol=1e-9)
    r = sol.reaction("hinge")
    assert r.force_world[-1] == pytest.approx([0, 0, 2 * 9.81], abs=1e-8)
    assert r.torque_world[-1] == pytest.approx([0, 2 * 9.81 * 0.4, 0], abs=1e-8)  # the bar lies along -x
    assert r.torque[-1] == pytest.approx(
        pin.exp3(np.array([0, np.pi / 2, 0])).T @ r.torque_world[-1], abs=1e-12
    )


def test_gears_split_a_torque_by_their_inertias():
    model = pin.Model()
    for name, inertia in (("motor", 0.02), ("drum", 0.5)):
        joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), inertia * np.eye(3)), pin.SE3.Identity())
    gear = Closure.coupling("motor", "drum", (0.0, -5.0), name="gear")
    mech = Mechanism(model, [gear], [JointTorque(joint="motor", torque=1.5)])
    sol = mbdae.solve(mech, (0, 1), rtol=1e-9)
    drum = -5 * 1.5 / (0.5 + 25 * 0.02)  # rad/s^2
    e = sol.effort("gear")
    assert sol.v[-1] == pytest.approx([-5 * drum, drum])
    assert e.counter == pytest.approx(np.full(len(sol.t), 0.5 * drum))
    assert e.effort == pytest.approx(e.counter / 5)
    assert e.power == pytest.approx(np.zeros(len(sol.t)))
    assert e.unique


def test_a_hoist_lifts_with_weight_and_acceleration():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "load")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(3.0, 0.1), pin.SE3.Identity())
    hoist = Driver.polynomial(("world", "load"), (1.0, 0.5, 0.7), name="hoist")
    model.addFrame(pin.Frame("load", joint, pin.SE3.Identity(), pin.FrameType.BODY))
    mech = Mechanism(model, drivers=[hoist], start=Start(guess={"load": -1.0}))
    sol = mbdae.solve(mech, (0, 1), rtol=1e-9)
    e, r = sol.effort("hoist"), sol.reaction("hoist")
    pull = 3.0 * (9.81 - 1.4)  # the rope is paid out with 1.4 m/s^2
    assert e.effort == pytest.approx(np.full(len(sol.t), -pull))
    assert e.power == pytest.approx(-pull * (0.5 + 1.4 * sol.t))
    assert e.position == pytest.approx(1 + 0.5 * sol.t + 0.7 * sol.t**2)
    assert r.force_world == pytest.approx(np.tile([0, 0, pull], (len(sol.t), 1)))


def test_both_limits_of_a_stop_have_their_effort(tmp_path):
    """A weight m g rests on the lower stop, and from 0.1 s on a force of 100 N presses it against the upper one."""
    m, path = 3.0, tmp_path / "slide.toml"
    path.write_text(f"""[[body]]
name = "x"
parent = "world"
joint = "prismatic"
mass = {m}
[[stop]]
name = "end"
joint = "x"
lower = 0.0
upper = 0.02
[[force]]
kind = "joint_torque"
joint = "x"
torque = {{ kind = "steps", points = [[0, 0], [0.1, 100]] }}
[start]
q = {{ x = 0.0 }}
""")
    sol = mbdae.solve(path, (0, 0.3), rtol=1e-8)
    found = sol.signals("effort")
    assert list(found) == ["effort.end lower", "effort.end upper"]
    for lower, upper, i in ((m * 9.81, 0.0, 0), (0.0, m * 9.81 - 100, -1)):
        assert [found[f"effort.end {side}"][i] for side in ("lower", "upper")] == pytest.approx([lower, upper])
        assert sol.effort("end").effort[i] == pytest.approx(lower + upper)
    moves = mbdae.sensitivity(sol, ["body.x.mass"])
    assert moves.signal("effort.end upper")[-1] == pytest.approx([9.81])


def test_undetermined_reactions_are_reported():
    mech = mbdae.load("four_bar")
    sol = mbdae.solve(mech, (0, 0.5), rtol=1e-8)
    r = sol.reaction("pin")
    across = np.array(r.unique[:3])
    assert across.sum() == 2  # two forces in the plane
    assert not across[np.abs(r.force).max(axis=0).argmin()]
    assert all(r.unique[3:])  # a point takes no torque
    assert "not unique: F" in str(r)
    assert sol.redundant == {"pin": 1}
    stop = mbdae.solve(mbdae.load("slider_crank_with_stop"), (0, 0.01), rtol=1e-6)
    assert stop.redundant == {"wrist pin": 1}  # an open stop has no reaction


def test_names_and_sorts_are_checked():
    sol = mbdae.solve(DRIVEN["crane"](), (0, 0.05), rtol=1e-6)
    with pytest.raises(UnknownNameError, match="unknown closure, driver or joint 'rope'; valid: stay, cart driver, "):
        sol.reaction("rope")
    with pytest.raises(InputError, match="use its effort"):
        sol.reaction("cart driver")
    with pytest.raises(InputError, match="use its reaction"):
        sol.effort("stay")


def test_multipliers_of_all_rows_have_the_smallest_norm():
    """For any masses, and also where the rows in use are singular to rounding."""
    rng = np.random.default_rng(0)
    used, C, X = rng.normal(size=(3, 6)), rng.normal(size=(2, 3)), rng.normal(size=(6, 6))
    U, lam, in_use = np.linalg.cholesky(X @ X.T + np.eye(6)).T, rng.normal(size=3), np.array([4, 0, 2])
    G = np.empty((5, 6))
    G[in_use], G[[1, 3]] = used, C @ used
    found = rows.all_multipliers(U, G, in_use, lam)
    np.testing.assert_allclose(found, np.linalg.pinv(G.T) @ (used.T @ lam), atol=1e-12)
    G[2] = G[4] + G[0]
    expected = np.linalg.pinv(G.T) @ (G[in_use].T @ lam)
    np.testing.assert_allclose(rows.all_multipliers(U, G, in_use, lam), expected, atol=1e-12)
    np.testing.assert_array_equal(rows.all_multipliers(U, np.zeros((2, 6)), in_use[:0], lam[:0]), 0.0)


def test_minimum_norm_in_a_singular_configuration():
    """Of the previous rank, one singular value vanishes: its quotient is no force, 0 / 0."""
    G = np.array([[1.0, 0, 0], [2.0, 0, 0], [1.0, 0, 0]])
    np.testing.assert_allclose(rows.minimum_norm(G, 2, np.array([6.0, 0, 0])), [1.0, 2.0, 1.0], atol=1e-14)
    G[2, 1] = 1e-12  # near it: still distinguishable
    np.testing.assert_allclose(rows.minimum_norm(G, 2, G.T @ [1.0, 2.0, 1.0]), [1.0, 2.0, 1.0], atol=1e-3)
