"""`mbdae.Simulator`: equal to runs, saved and restored exactly, with inputs whose effect has a closed form."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from chains import rod
from shared import shared_model

import mbdae
from mbdae import Input, JointTorque, Mechanism
from mbdae.mechanism.model_settings import Start

MODELS = ["slider_crank", "bricard", "pendulum_on_stop", "heavy_top", "arm"]
H = 1e-3


def model(name):
    """A model; the arm has a sampled controller, so that its states jump."""
    if name != "arm":
        return shared_model(name)
    mech = shared_model("four_bar")
    law = mbdae.Sampled(lambda t, q, v, x: (-0.5 * v[:1] + x, x + 0.01), rate=77.0, memory={"k": 0.0}, joints="crank")
    return Mechanism(mech.model, mech.closures, [law], start=mech.start_values)


def driven(hold="zero", value=0.0):
    """A pendulum with an input torque."""
    torque = Input(name="motor", value=value, unit="N m", hold=hold)
    return pendulum([JointTorque(joint="arm", torque=torque)])


def pendulum(forces):
    model = pin.Model()
    rod(model, 0, pin.SE3.Identity(), 1.0, "arm")
    return Mechanism(model, forces=forces, start=Start(q={"arm": 0.3}))


def advanced(simulator, n, dt=H):
    for _ in range(n):
        simulator.advance(dt)
    return simulator


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
@pytest.mark.parametrize("name", MODELS)
def test_advances_are_the_steps_of_a_run(name, method, backend):
    mech = model(name)
    n = 200 if backend == "native" else 30
    sol = mbdae.solve(mech, (0.0, n * H), method=method, step=H, backend=backend)
    simulator = advanced(mbdae.Simulator(mech, method=method, step=H, backend=backend), n)
    found = simulator.solution()
    assert found.status == sol.status
    if name == "arm":  # steps end some roundings before a jump, which depend on the end of the span
        assert found.t == pytest.approx(sol.t, abs=1e-14)
        assert found.y == pytest.approx(sol.y, abs=1e-12)
    else:
        assert np.array_equal(found.t, sol.t)
        assert np.array_equal(found.y, sol.y)
    assert np.array_equal(simulator.q, found.q[-1])
    assert found.stats["backend"] == backend


@pytest.mark.parametrize("options", [{"step": H}, {"rtol": 1e-7}, {"method": "radau5", "rtol": 1e-6}])
@pytest.mark.parametrize("name", MODELS)
def test_a_restored_simulator_continues_bit_by_bit(name, options):
    mech = model(name)
    one = advanced(mbdae.Simulator(mech, **options), 40, 7e-3)
    state = pickle.loads(pickle.dumps(one.save()))
    advanced(one, 40, 7e-3)
    other = mbdae.Simulator(mech, **options)
    other.restore(state)
    assert other.t == state.run.t
    advanced(other, 40, 7e-3)
    assert other.t == one.t
    for a, b in [(one.q, other.q), (one.v, other.v), (one.s, other.s)]:
        assert np.array_equal(a, b)
    other.restore(state)  # and once more, backward in time
    assert np.array_equal(advanced(other, 40, 7e-3).q, one.q)
    sol = one.solution()
    assert (sol.t[0], sol.t[-1]) == (0.0, one.t)
    assert sol.status == "finished"
    assert np.abs(sol(state.run.t).q - state.run.y[: mech.nq]).max() < 1e-12


def test_controlled_steps_end_at_each_advance():
    mech = shared_model("four_bar")
    simulator = mbdae.Simulator(mech, rtol=1e-9)
    exact = mbdae.solve(mech, (0.0, 0.4), rtol=1e-12)
    for t in (0.1, 0.17, 0.4):
        simulator.advance(t - simulator.t)
        assert simulator.t == pytest.approx(t, abs=1e-15)
        assert simulator.q == pytest.approx(exact(t).q, abs=1e-7)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("options", [{"step": 0.01}, {"rtol": 1e-10}, {"method": "radau5", "step": 0.01}])
def test_inputs_act_as_functions_of_time(hold, options):
    """A run of the recorded mechanism, whose inputs are functions of time, is the simulation."""
    simulator = mbdae.Simulator(driven(hold), **options)
    for k in range(30):
        simulator["motor"] = np.sin(0.3 * k)
        simulator.advance(0.01)
    sol = simulator.solution()
    torque = sol.mechanism.forces[0].torque
    if hold == "first":
        assert torque.at(0.105) == pytest.approx(0.5 * (np.sin(0.3 * 9) + np.sin(0.3 * 10)), abs=1e-12)
    else:
        assert torque.at(0.105) == pytest.approx(np.sin(0.3 * 10))
    exact = mbdae.solve(sol.mechanism, (0.0, 0.3), rtol=1e-12)
    limit = 1e-8 if "rtol" in options or options.get("method") else 1e-7
    assert sol.q[-1] == pytest.approx(exact.q[-1], abs=limit)
    assert sol.v[-1] == pytest.approx(exact.v[-1], abs=limit)
    i = int(np.searchsorted(sol.t, 0.155))
    assert sol.vdot[i] == pytest.approx(mbdae.solve(sol.mechanism, (0.0, sol.t[i]), rtol=1e-11).vdot[-1], abs=1e-5)


@pytest.mark.slow
def test_a_controller_in_python_holds_a_pendulum_upright():
    """A PD law at 1 kHz: the closed loop is that of the continuous law, to first order of its period."""
    simulator = mbdae.Simulator(driven(), step=H)
    q0 = simulator.q[0]
    for _ in range(3000):
        simulator["motor"] = 400.0 * (q0 + 0.2 - simulator.q[0]) - 60.0 * simulator.v[0]
        simulator.advance(H)
    assert abs(simulator.v[0]) < 1e-3
    assert abs(simulator.q[0] - q0 - 0.2) < 0.1
    assert simulator["motor"] == pytest.approx(simulator.mechanism.forces[0].torque.at(simulator.t))


def test_two_simulators_of_one_mechanism_have_their_own_inputs():
    mech = driven()
    one, two = mbdae.Simulator(mech, step=H), mbdae.Simulator(mech, step=H)
    one["motor"] = 5.0
    advanced(one, 50), advanced(two, 50)
    assert two["motor"] == 0.0
    free = mbdae.solve(mech, (0.0, 50 * H), step=H)
    assert np.array_equal(two.q, free.q[-1])
    assert one.q[0] != two.q[0]


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_inputs_are_saved_and_restored(hold):
    one = mbdae.Simulator(driven(hold), step=0.01)
    one["motor"] = 2.0
    one.advance(0.05)
    one["motor"] = 3.0
    state = pickle.loads(pickle.dumps(one.save()))
    one.advance(0.05)
    other = mbdae.Simulator(driven(hold), step=0.01)
    other.restore(state)
    assert other["motor"] == 3.0
    other.advance(0.05)
    assert np.array_equal(one.q, other.q)
    assert one.solution().mechanism.forces[0].torque.at(0.02) == pytest.approx(2.0 if hold == "zero" else 0.8)
    assert (np.diff(one.solution().t) < 1e-12).sum() == (2 if hold == "zero" else 0)


def test_inputs_of_files(tmp_path):
    text = """
[[input]]
name = "motor"
value = 0.5
unit = "N m"
hold = "first"
[[body]]
name = "arm"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = 1.0
com = [0, 0, -0.5]
inertia = [0.1, 0.1, 0.1, 0, 0, 0]
[[force]]
kind = "joint_torque"
joint = "arm"
torque = { input = "motor" }
"""
    path = tmp_path / "arm.toml"
    path.write_text(text)
    simulator = mbdae.Simulator(path, step=H)
    assert simulator["motor"] == 0.5
    simulator["motor"] = 1.0
    simulator.advance(0.1)
    saved = mbdae.Solution.load(simulator.solution().save(tmp_path / "run.npz") or tmp_path / "run.npz")
    assert saved.mechanism.forces[0].torque.at(0.05) == pytest.approx(0.75)
    path.write_text(text.replace('{ input = "motor" }', '{ input = "moter" }'))
    with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]*moter[^\n]*motor[^\n]*$"):
        mbdae.load(path)


def test_signals_are_those_of_solutions():
    simulator = advanced(mbdae.Simulator("slider_crank", step=H), 20)
    sol = simulator.solution()
    names = ["q.crank", "energy", "a.slider", "force.pin"]
    names = [n for n in sol.signals() if n in names] or list(sol.signals())[:4]
    expected = [sol.signals(n)[n][-1] for n in names]
    assert simulator.signals(*names) == pytest.approx(expected, rel=1e-9)


def test_a_terminal_event_pauses():
    simulator = mbdae.Simulator("four_bar", rtol=1e-8, events=mbdae.Event("q.crank = 1.0", terminal=True))
    assert simulator.advance(5.0) == "event"
    t = simulator.t
    assert 0 < t < 5
    assert simulator.signals("q.crank")[0] == pytest.approx(1.0, abs=1e-9)
    assert simulator.advance(1e-3) == "running"
    assert simulator.t == pytest.approx(t + 1e-3)


def test_memory_does_not_grow_without_a_record(monkeypatch):
    monkeypatch.setattr("mbdae.integrate.simulator.simulator.MAX_NODES", 50)
    kept = advanced(mbdae.Simulator("bricard", step=H), 400)
    lean = advanced(mbdae.Simulator("bricard", step=H, record=False), 400)
    assert len(lean._run.ts) < 60
    assert lean.q == pytest.approx(kept.q, abs=1e-12)


def test_wrong_use_is_one_line_and_loses_nothing():
    simulator = advanced(mbdae.Simulator(driven(), step=H), 5)
    for wrong in (0.0, -1.0, np.nan, np.inf, "x"):
        with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]+$"):
            simulator.advance(wrong)
    with pytest.raises(mbdae.MbdaeError, match=r"^[^\n]*engine[^\n]*motor[^\n]*$"):
        simulator["engine"] = 1.0
    with pytest.raises(mbdae.MbdaeError, match="finite"):
        simulator["motor"] = np.nan
    with pytest.raises(mbdae.MbdaeError, match="t_eval"):
        mbdae.Simulator("pendulum", t_eval=[0.1])
    with pytest.raises(mbdae.MbdaeError, match="stepp"):
        mbdae.Simulator("pendulum", stepp=0.1)
    assert simulator.solution().t[-1] == simulator.t == pytest.approx(5 * H)


def test_a_stopped_simulator_says_why():
    def fails(t, q, v):
        if t > 0.05:
            raise ValueError("broken sensor")
        return np.zeros(1)

    simulator = mbdae.Simulator(pendulum([fails]), step=0.01)
    with pytest.raises(mbdae.MbdaeError, match="broken sensor"):
        advanced(simulator, 10, 0.01)
    assert simulator.status == "force"
    with pytest.raises(mbdae.MbdaeError, match="stopped at t"):
        simulator.advance(0.01)
    sol = simulator.solution()
    assert sol.status == "force"
    assert sol.t[-1] == simulator.t > 0.03


def crank_driven(**keys):
    mech = shared_model("slider_crank")
    driver = mbdae.Driver(joint="crank", name="drive", **keys)
    return Mechanism(mech.model, mech.closures, drivers=[driver], start=mech.start_values)


@pytest.mark.parametrize("keys", [{"speed": Input(name="rate")}, {"motion": Input(name="rate", hold="first")}])
def test_an_input_that_lets_a_driver_jump_is_rejected(keys):
    with pytest.raises(mbdae.MbdaeError, match=r"drive.*rate.*impact.*hold = 'first'"):
        mbdae.Simulator(crank_driven(**keys))


@pytest.mark.parametrize("method", ["pherk5", "herk4", "radau5"])
@pytest.mark.parametrize("backend", ["native", "python"])
def test_a_driver_follows_the_speed_of_an_input(method, backend):
    """Speed and angle of the crank are the integrals in closed form; the run of the recorded inputs is the same."""
    rate = Input(name="rate", value=2.0, hold="first")
    simulator = mbdae.Simulator(crank_driven(speed=rate), method=method, step=0.01, backend=backend)
    speed, angle = 2.0, float(simulator.q[0])
    for wanted in (3.0, 3.0, 1.0, -1.0):
        simulator["rate"] = wanted
        simulator.advance(0.05)
        angle, speed = angle + 0.05 * (speed + wanted) / 2, wanted
        assert simulator.v[0] == pytest.approx(speed, abs=1e-12)
        assert simulator.q[0] == pytest.approx(angle, abs=1e-6)
    sol = simulator.solution()
    again = mbdae.solve(sol.mechanism, (0.0, 0.2), method=method, step=0.01, backend=backend)
    np.testing.assert_allclose(sol.y[-1], again.y[-1], atol=1e-9)
    assert max(abs(sol.signals("g")["g"]).max(), abs(sol.signals("Gv")["Gv"]).max()) < 1e-6


def test_two_simulators_of_a_model_have_inputs_of_their_own():
    mech = pendulum([JointTorque(joint="arm", torque=Input(name="motor"))])
    first, second = mbdae.Simulator(mech, step=0.01), mbdae.Simulator(mech, step=0.01)
    first["motor"] = 5.0
    advanced(first, 2, 0.01)
    advanced(second, 2, 0.01)
    np.testing.assert_array_equal(second.v, advanced(mbdae.Simulator(mech, step=0.01), 2, 0.01).v)
    assert abs(first.v[0] - second.v[0]) > 1e-3
