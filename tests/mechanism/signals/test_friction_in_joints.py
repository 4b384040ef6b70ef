"""Joint forces with closure friction, sticking and sliding contacts, stiction, stops, and engaged clutches."""

import numpy as np
import pinocchio as pin
import pytest
from test_joint_wrenches import momenta

import mbdae
from mbdae import Closure, Clutch, CoulombFriction, Mechanism
from mbdae.mechanism.closures.profiles import CircleProfile

MU, GRAVITY = 0.3, 9.81


def planar_body(joints, com=(0.1, -0.3, 0.0)):
    """A body in a vertical plane, x ahead and y up, that slides along x and y and turns about z."""
    model, parent = pin.Model(), 0
    model.gravity.linear = np.array([0, -GRAVITY, 0])
    for name in joints:
        kind = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelRZ}[name]()
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name)
        model.appendBodyToJoint(parent, pin.Inertia(0.1, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    inertia = pin.Inertia(0.3, np.array(com), np.diag([1e-3, 1e-3, 2e-3]))
    model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.addBodyFrame("body", parent, pin.SE3.Identity(), 0)
    return model


def closed(joints, closure, q, v, radius=None):
    friction = CoulombFriction(closure=closure.name, coefficient=MU, radius=radius, velocity=0.5)
    mech = Mechanism(planar_body(joints), [closure], [friction])
    return mbdae.solve(mech, (0, 0.2), np.array(q), np.array(v), rtol=1e-8)


def bead():
    return closed("xy", Closure.slot("world", "body", CircleProfile(radius=0.5), name="pin"), [0, -0.5], [1.0, 0])


def bearing(kind):
    return closed("xyz", Closure(kind=kind, frames=("world", "body"), name="pin"), [0, 0, 0], [0, 0, 2.0], 0.2)


def guided():
    return closed("xyz", Closure.prismatic("world", "body", axis=(1, 0, 0), name="pin"), [0, 0, 0], [0.4, 0, 0])


def flat():
    return closed("xyz", Closure.in_plane("world", "body", axis=(0, 1, 0), name="pin"), [0, 0, 0.2], [0.4, 0, 1.0])


def ball(radius=0.1):
    """It slides, and then rolls."""
    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    j = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(j, pin.Inertia(1.5, np.zeros(3), 0.006 * np.eye(3)), pin.SE3.Identity())
    model.addBodyFrame("centre", j, pin.SE3.Identity(), 0)
    floor = Closure.rolling("world", "centre", radius=radius, name="pin")
    mech = Mechanism(model, [floor], [CoulombFriction(closure="pin", coefficient=MU, exact=True)])
    v = np.array([1.5, 1.3, 0, 0, 0.0, 3.0])
    return mbdae.solve(mech, (0, 0.3), np.array([0, 0, radius, 0, 0, 0, 1.0]), v, rtol=1e-8)


def clutched():
    engaged = {"kind": "steps", "points": [(0, 0), (0.1, 1)]}
    clutch = Clutch(joints=tuple(mbdae.load("double_pendulum").joint_names[:2]), engaged=engaged, name="lock")
    mech = mbdae.load("double_pendulum", clutches=[clutch])
    return mbdae.solve(mech, (0, 0.3), rtol=1e-8)


def of_model(name, end):
    return lambda: mbdae.solve(mbdae.load(name), (0, end), rtol=1e-6)


RUNS = {
    "slot": bead,
    "point": lambda: bearing("point"),
    "revolute": lambda: bearing("revolute"),
    "prismatic": guided,
    "in_plane": flat,
    "grip": ball,
    "clutch": clutched,
    "friction": of_model("stick_slip_slider", 0.6),
    "stop": of_model("pendulum_on_stop", 3.0),
    "ratchet": of_model("ratchet", 1.0),
    "rubbing": of_model("woodpecker", 0.08),
}


def given(sol, i):
    """Joint forces and rows along the joint axes minus the torques of the rotors, (nv,)."""
    system, (q, v) = sol.at(i), (sol.q[i], sol.v[i])
    pin.forwardKinematics(system.model, system.workspace, q, v)
    G = system.jacobian(q)
    tau = np.array(system.generalized_force(sol.t[i], q, v, sol.s[i])[0], float)
    for part in system.constraints.joint_rows:
        tau += G[part.at] * sol.lam[i, part.at]
    return tau - sol.mechanism.model.armature * sol.vdot[i]


@pytest.mark.parametrize("name", RUNS)
def test_joint_forces_along_their_axes_are_the_applied_ones(name):
    """S_j^T f_j of the signals, 0 for joints without motors; and Newton and Euler of each body, from signals alone."""
    sol = RUNS[name]()
    assert sol.success, sol.message
    mech, signals = sol.mechanism, sol.signals()
    model, data = mech.model, mech.model.createData()
    kept = [i for i in range(len(sol.t)) if np.isfinite(sol.vdot[i]).all()]
    firsts = [first for first, _ in sol.modes]
    for i in sorted({*kept[:: max(1, len(kept) // 8)], *firsts[:6], kept[-1]}):
        q = sol.q[i]

        def wrench(joint, ends, i=i):
            return np.array([signals[f"{word}.{joint}.{k}"][i] for word in ("force", "torque") for k in ends])

        own = [wrench(joint, "123") for joint in mech.joint_names]
        scale = max(np.abs(own).max(), np.abs(sol.lam[i]).max(initial=0.0))
        pin.computeJointJacobians(model, data, q)
        wanted = given(sol, i)
        for j in range(1, model.njoints):
            at = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
            S = pin.getJointJacobian(model, data, j, pin.LOCAL).reshape(6, -1)[:, at]
            np.testing.assert_allclose(S.T @ own[j - 1], wanted[at], rtol=0, atol=1e-9 * scale, err_msg=model.names[j])
        np.testing.assert_allclose(rates(sol, i), acting(sol, i, wrench), rtol=0, atol=1e-8 * scale)


def rates(sol, i):
    """Rates of the momenta of bodies, (nj, 6), by differences of order six along the motion."""
    mech, q, v, vdot, h = sol.mechanism, sol.q[i], sol.v[i], sol.vdot[i], 1e-3 / (1 + np.abs(sol.v[i]).max())

    def there(x):
        return momenta(mech.model, mech.manifold.integrate(q, x * v + x * x / 2 * vdot), v + x * vdot)

    return sum(w * (there(k * h) - there(-k * h)) for k, w in {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}.items()) / h


def acting(sol, i, wrench):
    """Wrenches on each body at the world's origin, (nj, 6): weight, joints, and closures."""
    mech = sol.mechanism
    model, data = mech.model, mech.model.createData()
    pin.forwardKinematics(model, data, sol.q[i])
    out = np.zeros((model.njoints, 6))

    def add(joint, at, w):
        out[joint] += np.concatenate([w[:3], w[3:] + np.cross(at, w[:3])])

    for j in range(1, model.njoints):
        body, place, w = model.inertias[j], data.oMi[j], wrench(model.names[j], "xyz")
        add(j, place.act(body.lever), np.concatenate([body.mass * model.gravity.linear, np.zeros(3)]))
        add(j, place.translation, w)
        add(model.parents[j], place.translation, -w)
    for closure in (c for c in mech.closures if c.frames):
        a, b = (mbdae.mechanism.tree.frames.anchor(model, n) for n in closure.frames)
        w, at = wrench(closure.name, "xyz"), data.oMi[b.joint].act(b.p)
        add(b.joint, at, w)
        add(a.joint, at, -w)
    return out[1:]


def test_a_bearing_has_the_torque_of_its_friction():
    """mu r |F| tanh(w/width) against the rotation, in the signal and in the reaction."""
    sol = bearing("revolute")
    signals, found = sol.signals(), sol.reaction("pin")
    load = MU * 0.2 * np.linalg.norm(found.force, axis=1) * np.tanh(sol.v[:, 2] / 0.5)
    np.testing.assert_allclose(signals["torque.pin.z"], -load, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.torque[:, 2], -load, rtol=1e-9, atol=1e-12)


def test_a_sliding_ball_has_full_friction():
    """And zero friction when it rolls; contact, closure and the ball's acceleration give the same force."""
    sol = ball()
    signals, contact = sol.signals(), sol.contact("pin")
    slides = signals["mode.pin grip"] == 2
    assert slides.any()
    assert not slides.all()
    np.testing.assert_allclose(contact.friction[slides], MU, rtol=1e-9)
    along = np.array([signals[f"force.pin.{x}"] for x in "xy"])
    momentum = 1.5 * np.array([signals[f"acceleration.centre.{x}"] for x in "xy"])
    np.testing.assert_allclose(np.linalg.norm(along, axis=0)[slides], MU * 1.5 * GRAVITY, rtol=1e-9)
    ends = np.isclose(sol.t, sol.t[sol.modes[1][0]], atol=1e-12)  # the slip is 1e-9 m/s: its direction has seven digits
    np.testing.assert_allclose(along[:, ~ends], momentum[:, ~ends], atol=1e-8)
    np.testing.assert_allclose(along[:, ends], momentum[:, ends], atol=1e-6)
    assert np.abs(along[:, ~slides]).max() < 1e-6
