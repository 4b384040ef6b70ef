"""Forces in joints of the tree: Newton and Euler body by body, and another cut of the same loop."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, tree
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


def about_origin(p, wrench):
    """A force and a torque at p, as a force and a torque about the world's origin."""
    return np.concatenate([wrench[:3], wrench[3:] + np.cross(p, wrench[:3])])


def balance(mech, state, wrenches, loads=()):
    """Rates of momenta, by differences of order six along the motion, and the sums of all forces on each body.

    Loads are (a, b, wrench): it acts on the body of frame b at its origin, in axes of the world, its opposite on a.
    """
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
        acting[j] += about_origin(place.act(body.lever), np.append(body.mass * model.gravity.linear, np.zeros(3)))
        whole = about_origin(place.translation, (wrenches[j - 1].reshape(2, 3) @ place.rotation.T).ravel())
        acting[j] += whole
        acting[model.parents[j]] -= whole
    loads = list(loads)
    for closure in mech.closures:
        found = mbdae.mechanism.reaction(mech, closure.name, np.array([t]), q[None], lam[None])
        loads.append((*closure.frames, np.concatenate([found.force_world[0], found.torque_world[0]])))
    for name_a, name_b, wrench in loads:
        a, b = (mbdae.mechanism.tree.frames.anchor(model, n) for n in (name_a, name_b))
        whole = about_origin(data.oMi[b.joint].act(b.p), wrench)
        acting[b.joint] += whole
        acting[a.joint] -= whole
    return rate, acting[1:]


@pytest.mark.parametrize("model", ["four_bar", "slider_crank", "panda_handle", "delta_robot", "bricard"])
def test_newton_and_euler_body_by_body(model):
    mech = mbdae.load(model)
    _, state, wrenches = at_end(mech)
    rate, acting = balance(mech, state, wrenches)
    np.testing.assert_allclose(rate, acting, rtol=0, atol=1e-10 * np.abs(wrenches).max())


def test_forces_between_frames_and_every_kind_of_joint():
    """All six components of each joint, with the forces of the laws by hand."""
    kinds = ["free", "universal", "composite", "spherical", "prismatic", "planar", "continuous"]
    model, rng = tree(kinds, [0, 1, 2, 1, 4, 0, 6]), np.random.default_rng(1)
    q, v, vdot = random_q(model, rng), rng.standard_normal(model.nv), rng.standard_normal(model.nv)
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    pin.updateFramePlacements(model, data)
    at = {f.name: data.oMf[model.getFrameId(f.name)] for f in model.frames}
    rate = {n: pin.getFrameVelocity(model, data, model.getFrameId(n), pin.LOCAL_WORLD_ALIGNED) for n in at}
    gap, opening = (x["tip_4"] - x["tip_2"] for x in ({n: m.translation for n, m in at.items()},
                                                      {n: V.linear for n, V in rate.items()}))  # fmt: skip
    n = gap / np.linalg.norm(gap)
    spring = -(50.0 * (np.linalg.norm(gap) - 0.2) + 3.0 * opening @ n) * n
    R, K, D = at["ground"].rotation, np.array([50, 60, 70, 2, 3, 4]), np.array([1, 2, 3, 0.1, 0.2, 0.3])
    shift, turn = R.T @ (at["tip_6"].translation - at["ground"].translation), pin.log3(R.T @ at["tip_6"].rotation)
    assert np.linalg.norm(turn) < 3.0, "within the range of a bushing"
    push = -K[:3] * shift - D[:3] * (R.T @ rate["tip_6"].linear)
    moment = -pin.Jlog3(pin.exp3(turn)) @ (K[3:] * turn) - D[3:] * (R.T @ rate["tip_6"].angular)
    loads = [
        ("tip_2", "tip_4", np.append(spring, np.zeros(3))),
        ("ground", "tip_6", np.append(R @ push, R @ moment)),
        ("ground", "tip_3", np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])),
    ]
    forces = [
        SpringDamper(frames=("tip_2", "tip_4"), stiffness=50.0, damping=3.0, length=0.2),
        Bushing(frames=("ground", "tip_6"), stiffness=tuple(K), damping=tuple(D)),
        Wrench(frame="tip_3", force=(1.0, 2.0, 3.0), torque=(0.1, 0.2, 0.3)),
    ]
    mech = Mechanism(model, forces=forces)
    wrenches = joint_wrenches(mech.system(), 0.0, q, v, vdot, np.empty(0))
    found, acting = balance(mech, (0.0, q, v, vdot, np.empty(0)), wrenches, loads)
    np.testing.assert_allclose(found, acting, rtol=0, atol=1e-9 * np.abs(wrenches).max())


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
    """Columns by name: magnitudes and both axes of `joint_wrenches`, which they are computed by, and of closures.

    This tests names and axes; the values are tested by the balances above.
    """
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
