"""Forces in joints of the tree: Newton and Euler body by body, and another cut of the same loop."""

import numpy as np
import pinocchio as pin
import pytest
from chains import tree
from linkages import bar, four_bar, point

import mbdae
from mbdae import Bushing, Closure, Mechanism, SpringDamper, Wrench
from mbdae.mechanism.model_settings import Start
from mbdae.mechanism.signals.joint_wrenches import joint_wrenches


def at_end(mech, end=0.2):
    """A state with its acceleration and multipliers, and the wrenches there."""
    sol = mbdae.solve(mech, (0, end), rtol=1e-8)
    system, t, y = mech.system(), float(sol.t[-1]), sol.y[-1]
    q, v = system.split(y)
    F, lam = system.derivative(t, y)
    vdot = F[mech.nv : 2 * mech.nv]
    return system, (t, q, v, vdot, lam), joint_wrenches(system, t, q, v, vdot, lam)


def momenta(model, q, v):
    """Momentum and angular momentum about the world's origin of each body, (nj, 6), from its mass and inertia."""
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    out = []
    for j in range(1, model.njoints):
        body, place, V = model.inertias[j], data.oMi[j], data.oMi[j].act(data.v[j])
        c = place.act(body.lever)
        p = body.mass * (V.linear + np.cross(V.angular, c))
        spin = place.rotation @ body.inertia @ place.rotation.T @ V.angular
        out.append(np.concatenate([p, np.cross(c, p) + spin]))
    return np.array(out)


def balance(mech, system, state, wrenches):
    """Rates of momenta, by differences of order six along the motion, minus all forces on each body."""
    t, q, v, vdot, lam = state
    model, h, weights = mech.model, 1e-3, {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}

    def there(x):
        return momenta(model, mech.manifold.integrate(q, x * v + x * x / 2 * vdot), v + x * vdot)

    rate = sum(w * (there(k * h) - there(-k * h)) for k, w in weights.items()) / h
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    acting = np.zeros((model.njoints, 6))
    for j in range(1, model.njoints):
        place, body = data.oMi[j], model.inertias[j]
        weight = body.mass * model.gravity.linear
        acting[j] += np.concatenate([weight, np.cross(place.act(body.lever), weight)])
        f, m = place.rotation @ wrenches[j - 1, :3], place.rotation @ wrenches[j - 1, 3:]
        whole = np.concatenate([f, m + np.cross(place.translation, f)])
        acting[j] += whole
        acting[model.parents[j]] -= whole
    for closure in mech.closures:
        found = mbdae.mechanism.reaction(mech, closure.name, np.array([t]), q[None], lam[None])
        a, b = (mbdae.mechanism.tree.frames.anchor(model, n) for n in closure.frames)
        at = data.oMi[b.joint].act(b.p)
        f, m = found.force_world[0], found.torque_world[0]
        whole = np.concatenate([f, m + np.cross(at, f)])
        acting[b.joint] += whole
        acting[a.joint] -= whole
    return rate, acting[1:]


@pytest.mark.parametrize("model", ["four_bar", "slider_crank", "panda_handle", "delta_robot", "bricard"])
def test_newton_and_euler_body_by_body(model):
    mech = mbdae.load(model)
    system, state, wrenches = at_end(mech)
    rate, acting = balance(mech, system, state, wrenches)
    np.testing.assert_allclose(rate, acting, rtol=0, atol=1e-10 * np.abs(wrenches).max())


def test_forces_between_frames_and_every_kind_of_joint():
    kinds = ["free", "universal", "composite", "spherical", "prismatic", "planar", "continuous"]
    model = tree(kinds, [0, 1, 2, 1, 4, 0, 6])
    forces = [
        SpringDamper(frames=("tip_2", "tip_4"), stiffness=50.0, damping=3.0, length=0.2),
        Bushing(frames=("ground", "tip_6"), stiffness=(50, 60, 70, 2, 3, 4), damping=(1, 2, 3, 0.1, 0.2, 0.3)),
        Wrench(frame="tip_3", force=(1.0, 2.0, 3.0), torque=(0.1, 0.2, 0.3)),
    ]
    mech = Mechanism(model, forces=forces)
    rng = np.random.default_rng(1)
    q, v, vdot = pin.randomConfiguration(_bounded(model)), rng.standard_normal(model.nv), rng.standard_normal(model.nv)
    system = mech.system()
    system.inertia(0.0, q)
    tau = system.torque(0.0, q, v, np.empty(0))[0]
    wrenches = joint_wrenches(system, 0.0, q, v, vdot, np.empty(0))
    data = model.createData()
    pin.rnea(model, data, q, v, vdot)
    missing = data.tau - tau  # required joint forces
    pin.computeJointJacobians(model, data, q)
    for j in range(1, model.njoints):
        s = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
        J = pin.getJointJacobian(model, data, j, pin.LOCAL)[:, s]
        np.testing.assert_allclose(J.T @ wrenches[j - 1], missing[s], atol=1e-11 * np.abs(wrenches).max())


def _bounded(model):
    model.lowerPositionLimit, model.upperPositionLimit = -np.ones(model.nq), np.ones(model.nq)
    return model


def test_another_cut_of_the_loop():
    """The same four-bar with its loop open at the crank's pin instead of the rocker's."""
    first = four_bar((1.0, 2.0, 1.5, 2.0), {"q": {"crank": 1.2}, "guess": {"coupler": -0.9, "rocker": 1.4}})
    model = pin.Model()
    bar(model, 0, (0, 0), 1.0, "crank")
    rocker = bar(model, 0, (2, 0), 1.5, "rocker")
    coupler = bar(model, rocker, (1.5, 0), 2.0, "coupler")
    inertia = model.inertias[coupler]  # seen from the other end
    inertia.lever = np.array([-1.0, 0, 0])
    model.inertias[coupler] = inertia
    point(model, coupler, (-2.0, 0), "coupler_start")
    pins = [Closure.revolute("crank_tip", "coupler_start", axis=(0, 1, 0), name="pin")]
    q = first.start[0]
    start = Start(q={"crank": q[0]}, guess={"rocker": q[2], "coupler": q[0] + q[1] - q[2]})
    second = Mechanism(model, pins, start=start)
    found = {}
    for mech in (first, second):
        system, (t, q, *_, lam), wrenches = at_end(mech, 0.3)
        closure = mbdae.mechanism.reaction(mech, "pin", np.array([t]), q[None], lam[None]).force_world[0]
        forces = {n: system.workspace.oMi[j + 1].rotation @ wrenches[j, :3] for j, n in enumerate(mech.joint_names)}
        found[mech] = {"crank": forces["crank"], "rocker": forces["rocker"]} | (
            {"start": forces["coupler"], "end": closure}
            if mech is first
            else {"start": closure, "end": -forces["coupler"]}
        )
    for name, force in found[first].items():
        np.testing.assert_allclose(found[second][name], force, atol=1e-6, err_msg=name)  # two runs at rtol 1e-8


def test_signals_and_reactions_agree():
    """Columns of forces by name: those of `joint_wrenches`, in balance, and of closures; magnitudes and both axes."""
    mech = mbdae.load("panda_handle")
    sol = mbdae.solve(mech, (0, 0.2), rtol=1e-8)
    system, _, wrenches = at_end(mech)
    signals = sol.signals()
    for j, name in enumerate(mech.joint_names):
        for word, own in (("force", wrenches[j, :3]), ("torque", wrenches[j, 3:])):
            columns = np.array([signals[f"{word}.{name}.{k}"][-1] for k in "123"])
            np.testing.assert_allclose(columns, own, rtol=0, atol=1e-9)
            world = np.array([signals[f"{word}.{name}.{k}"][-1] for k in "xyz"])
            np.testing.assert_allclose(world, system.workspace.oMi[j + 1].rotation @ own, rtol=0, atol=1e-9)
            assert signals[f"{word}.{name}"][-1] == pytest.approx(np.linalg.norm(own))
    hand, joint = sol.reaction("hand on handle"), sol.reaction("panda_joint4")
    np.testing.assert_allclose(signals["force.hand on handle.1"], hand.force[:, 0], atol=1e-10)
    np.testing.assert_allclose(signals["torque.hand on handle.z"], hand.torque_world[:, 2], atol=1e-10)
    np.testing.assert_allclose(signals["torque.panda_joint4.2"], joint.torque[:, 1], atol=1e-12)
    assert all(joint.unique)
    at = mech.coordinates({"handle": 0.0}, of_v=True)[1][0]
    np.testing.assert_allclose(signals["a.handle"], sol.vdot[:, at], atol=0)


def test_components_undetermined_by_a_planar_loop_are_reported():
    sol = mbdae.solve(mbdae.load("slider_crank"), (0, 0.2), rtol=1e-6)
    assert sol.reaction("crank").unique == (True, False, True, False, True, False)  # along y, and torques about x and z
