"""Columns of solutions: each force's effort and power, frames, momentum, one list of names with units everywhere."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import simpson
from shared import shared_model
from signal_names import without_work

import mbdae
from mbdae.errors import UnknownNameError
from mbdae.finite_differences import STENCIL, central_difference
from mbdae.mechanism.time_functions.time_functions import Harmonic
from mbdae.solution.signal_value import signal_values, value
from mbdae.solution.signals import signals, units

TIMES = np.linspace(0, 0.3, 151)
WAVE = Harmonic(amplitude=2.0, omega=3.0, phase=0.4, offset=0.7)
FORCES = {
    "joint_spring": mbdae.JointSpring(joint=("crank", "rocker"), stiffness=4.0, rest=0.3, damping=0.1),
    "joint_friction": mbdae.JointFriction(joint="rocker", friction=0.5, velocity=0.5),
    "joint_pid": mbdae.JointPID(joint="crank", kp=3.0, ki=2.0, kd=0.2, reference=WAVE),
    "dc_motor": mbdae.DCMotor(joint="crank", voltage=6.0, resistance=1.0, inductance=0.05, constant=0.4, gear=2.0),
    "spring_damper": mbdae.SpringDamper(
        frames=("world", "coupler_tip"), stiffness=20.0, damping=0.5, length=0.2, force=WAVE
    ),
    "bushing": mbdae.Bushing(frames=("crank", "rocker"), stiffness=(40, 90, 20, 3, 0.7, 5), damping=(0.1,) * 6),
    "wrench": mbdae.Wrench(frame="coupler_tip", force=(1.0, 0.0, 2.0), torque=(0.0, 0.3, 0.0)),
    "wrench, turning": mbdae.Wrench(frame="coupler_tip", force=(1.0, WAVE, 2.0), axes="frame"),
    "python": lambda t, q, v: np.array([np.cos(3 * t), 0.1 * v[0], -0.2 * q[0] * v[1]]),
}


def run(force, model="four_bar", t_eval=TIMES):
    mech = shared_model(model)
    own = mbdae.Mechanism(
        mech.model, mech.closures, [force] if force else mech.forces, drivers=mech.drivers, start=mech.start_values
    )
    return mbdae.solve(own, (0, t_eval[-1]), t_eval=t_eval, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("name", FORCES)
def test_power_is_the_rate_of_kinetic_energy_and_of_the_weight(name):
    # closures do no work: kinetic energy changes by the powers of forces and of the weight at the centre of mass
    sol = run(FORCES[name])
    model, found = sol.mechanism.model, sol.signals()
    power = sum(x for n, x in found.items() if n.startswith("power."))
    mass = sum(Y.mass for Y in model.inertias[1:])
    weight = mass * sum(g * found[f"com.{axis}"] for g, axis in zip(sol.mechanism.gravity, "xyz", strict=True))
    gained = found["kinetic"] - found["kinetic"][0] - weight + weight[0]
    assert gained[-1] == pytest.approx(simpson(power, x=sol.t), rel=1e-6, abs=1e-8)
    assert np.abs(power).max() > 1e-3


def test_efforts_are_the_laws():
    spring = run(FORCES["joint_spring"], t_eval=TIMES[::10]).signals()
    for joint in ("crank", "rocker"):
        stretched, name = spring[f"q.{joint}"] - 0.3, f"joint_spring 1.{joint}"
        assert spring[f"deflection.{name}"] == pytest.approx(stretched, abs=1e-14)
        assert spring[f"torque.{name}"] == pytest.approx(-4.0 * stretched - 0.1 * spring[f"v.{joint}"], abs=1e-12)
    motor = run(FORCES["dc_motor"], t_eval=TIMES[::10]).signals()
    assert motor["torque.dc_motor 1"] == pytest.approx(2.0 * 0.4 * motor["s.dc_motor 1.current"], abs=1e-12)
    assert motor["power.dc_motor 1"] == pytest.approx(motor["torque.dc_motor 1"] * motor["v.crank"], abs=1e-12)
    line = run(FORCES["spring_damper"], t_eval=TIMES[::10]).signals()
    p, v = (np.stack([line[f"{word}.coupler_tip.{x}"] for x in "xyz"]) for word in ("position", "velocity"))
    d = np.linalg.norm(p, axis=0)
    push = np.array([WAVE.at(t) for t in line["t"]])
    assert line["deflection.spring_damper 1"] == pytest.approx(d - 0.2, abs=1e-13)
    pull = 20 * (d - 0.2) + 0.5 * (p * v).sum(axis=0) / d - push
    assert line["force.spring_damper 1"] == pytest.approx(pull, abs=1e-11)


def test_wrenches_and_bushings_have_components():
    pushed = run(FORCES["wrench"], t_eval=TIMES[::10]).signals()
    assert [pushed[f"force.wrench 1.{x}"][7] for x in "xyz"] == pytest.approx([1, 0, 2])
    assert pushed["torque.wrench 1"][7] == pytest.approx(0.3)
    sol = run(FORCES["bushing"], t_eval=TIMES[::10])
    found, data = sol.signals(), sol.mechanism.model.createData()
    pin.framesForwardKinematics(sol.mechanism.model, data, sol.q[-1])
    a, b = (data.oMf[sol.mechanism.model.getFrameId(n)] for n in ("crank", "rocker"))
    gap = a.rotation.T @ (b.translation - a.translation)
    turn = pin.log3(a.rotation.T @ b.rotation)
    names = [f"deflection.bushing 1.{x}" for x in ("x", "y", "z", "rx", "ry", "rz")]
    assert [found[name][-1] for name in names] == pytest.approx([*gap, *turn])


def test_frames_and_momentum_follow_their_definitions():
    sol = run(None, "slider_crank")
    found, h = sol.signals(), TIMES[1]
    for frame in ("rod_tip", "crank_pin"):
        for x in "xyz":
            for low, high in (("position", "velocity"), ("velocity", "acceleration")):
                y = found[f"{low}.{frame}.{x}"]
                rate = central_difference({k: y[3 + k : len(y) - 3 + k] for k in STENCIL}, h)
                assert found[f"{high}.{frame}.{x}"][3:-3] == pytest.approx(rate, abs=1e-4)
    model = sol.mechanism.model
    data = model.createData()
    for i in (0, 100):
        whole = pin.computeCentroidalMomentum(model, data, sol.q[i], sol.v[i])
        com = pin.centerOfMass(model, data, sol.q[i])
        for k, x in enumerate("xyz"):
            assert found[f"com.{x}"][i] == pytest.approx(com[k], abs=1e-14)
            assert found[f"momentum.{x}"][i] == pytest.approx(whole.linear[k], abs=1e-13)
            assert found[f"angular_momentum.{x}"][i] == pytest.approx(whole.angular[k], abs=1e-13)


@pytest.mark.parametrize("name", ["slider_crank", "stewart_platform", "heavy_top"])
def test_the_shaking_force_is_the_rate_of_momentum(name):
    times = np.arange(-3, 4) * 1e-3 + 0.05
    sol = mbdae.solve(shared_model(name), (0.0, 0.06), rtol=1e-12, t_eval=times)
    found = sol.signals()
    c, p, h = (np.array([found[f"{word}.{x}"] for x in "xyz"]) for word in ("com", "momentum", "angular_momentum"))
    about_origin = h + np.cross(c.T, p.T).T
    for word, moved in (("force", p), ("moment", about_origin)):
        rate = central_difference({k: moved[:, 3 + k] for k in STENCIL}, 1e-3)
        now = np.array([found[f"shaking_{word}.{x}"][3] for x in "xyz"])
        assert now == pytest.approx(-rate, abs=1e-6 * np.abs(rate).max())
        assert found[f"shaking_{word}"][3] == pytest.approx(np.linalg.norm(now))


def test_counterweights_balance_a_four_bar():
    """Berkof, Lowen (1969): with the coupler's mass in its middle, half of it is balanced at each side."""
    mech = shared_model("four_bar")
    model = mech.model.copy()
    crank, coupler, rocker = (model.getJointId(name) for name in ("crank", "coupler", "rocker"))
    tip, end = (model.frames[model.getFrameId(name)].placement.translation for name in ("rocker_tip", "coupler_tip"))
    half = model.inertias[coupler].mass / 2
    levers = {crank: model.jointPlacements[coupler].translation, rocker: tip}
    for joint, arm in levers.items():
        body = model.inertias[joint]
        model.inertias[joint] = pin.Inertia(body.mass, -half / body.mass * arm, body.inertia)
    model.inertias[coupler] = pin.Inertia(2 * half, end / 2, model.inertias[coupler].inertia)
    sol = mbdae.solve(mbdae.Mechanism(model, mech.closures, start=mech.start_values), (0.0, 1.0), rtol=1e-10)
    assert signals(sol, ["shaking_force"])["shaking_force"].max() < 1e-10
    unbalanced = signals(mbdae.solve(mech, (0.0, 1.0), rtol=1e-6), ["shaking_force", "shaking_moment"])
    assert min(x.max() for x in unbalanced.values()) > 1.0


def test_drivers_have_their_power():
    mech = shared_model("slider_crank")
    drive = mbdae.Driver(name="drive", joint="crank", speed=2.0)
    driven = mbdae.Mechanism(mech.model, mech.closures, drivers=[drive], start=mech.start_values)
    sol = mbdae.solve(driven, (0, 0.5))
    found = sol.signals()
    assert found["effort.drive"] == pytest.approx(sol.effort("drive").effort)
    assert found["power.drive"] == pytest.approx(2 * found["effort.drive"])


@pytest.mark.parametrize("model", ["slider_crank", "bicycle", "double_pendulum", "flyball_governor", "spring_four_bar"])
def test_every_name_has_a_unit_and_a_value_at_a_point(model):
    mech = shared_model(model)
    sol = mbdae.solve(mech, (0, 0.02))
    assert set(signal_values(mech)) == set(units(mech))
    known = without_work(mech)
    found = sol.signals()
    assert list(found) == list(known)
    assert set(known.values()) <= {
        "s", "rad", "m", "1", "rad/s", "m/s", "rad/s^2", "m/s^2", "N", "N m", "W", "J", "kg m/s", "kg m^2/s", "m, rad",
        "m/s, rad/s", "",
    }  # fmt: skip
    system = mech.system()
    for name in [*list(known)[::17], "g"]:
        now = value(system, signal_values(mech)[name], float(sol.t[-1]), sol.y[-1])
        turns = (now - found[name][-1]) / (2 * np.pi)
        assert now == pytest.approx(found[name][-1], rel=1e-7, abs=1e-7) or abs(turns - round(turns)) < 1e-9, name


def test_names_and_beginnings_choose():
    sol = mbdae.solve(shared_model("slider_crank"), (0, 0.1))
    assert list(signals(sol, ["position.rod_tip", "g"])) == [*(f"position.rod_tip.{x}" for x in "xyz"), "g"]
    assert list(signals(sol, "q")) == ["q.crank", "q.crank_pin", "q.slider"]
    with pytest.raises(UnknownNameError, match="did you mean"):
        signals(sol, ["q.slidr"])


def test_a_force_with_the_name_of_a_joint_is_distinguished():
    force = mbdae.JointTorque(name="crank", joint="crank", torque=2.0)
    found = run(force).signals()
    assert (found["torque.crank (force)"] == 2.0).all()
    assert "torque.crank.1" in found
