"""Mechanisms driven by FMUs of other programs, against the discrete system of cart and motor."""

import ctypes
import gc

import numpy as np
import pinocchio as pin
import pytest
from motors import DEGREE, motor
from scipy.signal import cont2discrete

import mbdae
from mbdae import FMU, Mechanism
from mbdae.mechanism.fmu import instance
from mbdae.mechanism.model_settings import Start

MASS, STEP, END = 2.0, 0.02, 1.0
KP, KD, LAG, REFERENCE = 30.0, 4.0, 0.05, 0.5
SIGNALS = ("q.crank", "v.slider", "a.crank", "force.wrist pin", "position.rod_tip.x", "s.spin.current")
NUMBERS = {"kp": KP, "kd": KD, "T": LAG, "reference": REFERENCE}


def cart(*forces, joints=1):
    """Masses on rails, each with a force."""
    model = pin.Model()
    for name in [f"cart {k}" for k in range(joints)]:
        at = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(at, pin.Inertia(MASS, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity())
    start = Start(q=dict.fromkeys(model.names[1:], 0.3), v=dict.fromkeys(model.names[1:], 1.0))
    return Mechanism(model, forces=forces, start=start, title="cart")


def drive(path, joint="cart 0", **changes):
    """A motor on a cart."""
    given = {"file": str(path), "step": STEP, "parameters": NUMBERS, "name": f"motor of {joint}"}
    given |= {"inputs": {"angle": f"q.{joint}", "speed": f"v.{joint}"}, "outputs": {"torque": joint}}
    return FMU(**(given | changes))


def discrete(lag=LAG, end=END):
    """Position and speed after samples of the linear system, exact between them; and the last force."""
    A, B, _, _, _ = cont2discrete((np.diag([1.0], 1), np.array([[0], [1 / MASS]]), np.eye(2), np.zeros((2, 1))), STEP)
    motor_system = -np.eye(1) / lag, np.eye(1) / lag, np.eye(1), np.zeros((1, 1))
    keep, new = (x.item() for x in cont2discrete(motor_system, STEP)[:2])
    x, force, demand = np.array([0.3, 1.0]), 0.0, None
    for _ in range(round(end / STEP)):
        force = keep * force + new * demand if demand is not None else 0.0
        demand = KP * (REFERENCE - x[0]) - KD * x[1]
        x = A @ x + B[:, 0] * force
    return x, force


@pytest.mark.parametrize("version", [2, 3])
def test_a_motor_and_a_cart_are_a_discrete_system(version, back_end, tmp_path):
    sol = mbdae.solve(cart(drive(motor(tmp_path, version))), (0, END), step=STEP / 2)
    (x, v), force = discrete()
    assert sol.stats["backend"] == back_end
    np.testing.assert_allclose([sol.q[-1, 0], sol.v[-1, 0], sol.s[-1, 0]], [x, v, force], rtol=1e-10)
    assert int(sol.s[-1, 1]) == round(END / STEP)
    again = mbdae.solve(sol.problem, (0, END), step=STEP / 2)
    np.testing.assert_array_equal(again.y, sol.y)
    assert mbdae.drift(sol).energy_relative < 1e-12


def test_an_fmu_without_states_is_a_sampled_controller(tmp_path):
    pd = mbdae.JointPID(joint="cart 0", kp=KP, kd=KD, reference=REFERENCE, rate=1 / STEP)
    one, other = (
        mbdae.solve(cart(x), (0, END), rtol=1e-10) for x in (pd, drive(motor(tmp_path), parameters=NUMBERS | {"T": 0}))
    )
    np.testing.assert_allclose(other.y[-1, :2], one.y[-1, :2], rtol=1e-12)


@pytest.mark.parametrize(("version", "offset"), [(3, 0.0), (2, 273.15), (3, 273.15)])  # which differences do not have
def test_units_of_the_fmu_are_converted(version, offset, tmp_path):
    numbers = {name: NUMBERS[name] * DEGREE / 0.01 for name in ("kp", "kd")}
    numbers |= {"T": LAG, "reference": REFERENCE / DEGREE}
    path = motor(tmp_path, version, units=True, offset=offset)
    sol = mbdae.solve(cart(drive(path, parameters=numbers)), (0, END), step=STEP / 2)
    np.testing.assert_allclose([sol.q[-1, 0], sol.v[-1, 0]], discrete()[0], rtol=1e-10)


@pytest.mark.parametrize("version", [2, 3])
def test_a_parameter_may_be_an_item_of_an_enumeration(version, tmp_path):
    numbers = NUMBERS | {"kp": KP / 2, "kd": KD / 2, "gain": 2}
    path = motor(tmp_path, version, gain="Enumeration")
    sol = mbdae.solve(cart(drive(path, parameters=numbers)), (0, END), step=STEP / 2)
    np.testing.assert_allclose([sol.q[-1, 0], sol.v[-1, 0]], discrete()[0], rtol=1e-10)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("signal", SIGNALS)
def test_any_signal_is_an_input(signal, tmp_path):
    """The output is 1e-3 of the input: at each instant that of the run just before."""
    spin = mbdae.DCMotor(joint="crank", voltage=0.5, resistance=1.0, inductance=0.1, constant=0.4, name="spin")
    numbers = {"kp": 0, "gain": 0, "feed": 1e-3}
    probe = drive(motor(tmp_path), "crank", inputs={"speed": signal}, parameters=numbers, name="probe")
    m = mbdae.load("slider_crank", forces=[spin, probe])
    sol = mbdae.solve(m, (0, 0.1), step=STEP / 4)
    found, expected = (sol.signals(name)[name] for name in ("s.probe.torque crank", signal))
    jumps = np.flatnonzero(np.diff(sol.t) < 1e-9)
    assert len(jumps) == 4
    np.testing.assert_allclose(found[jumps + 1], 1e-3 * expected[jumps], rtol=1e-9, atol=1e-15)


def test_a_gap_is_an_input_while_a_stop_is_open_and_closed(tmp_path):
    numbers = {"kp": 0, "gain": 0, "feed": -1e-2}
    probe = drive(motor(tmp_path), "rod", inputs={"speed": "gap.rod stop", "angle": 0.25}, parameters=numbers)
    m = mbdae.load("pendulum_on_stop", forces=[probe])
    sol = mbdae.solve(m, (0, 1), step=1e-2, method="pherk5")
    assert sol.impacts
    found, gap = (sol.signals(name)[name] for name in ("s.motor of rod.torque rod", "gap.rod stop"))
    at = [int(np.flatnonzero(np.abs(sol.t - k * STEP) < 1e-9)[0]) for k in range(1, 50)]
    np.testing.assert_allclose(found[np.add(at, 1)], -1e-2 * gap[at], rtol=1e-9, atol=1e-12)


def test_several_fmus_have_their_own_states(tmp_path):
    """Two carts, two motors of one file; the second with another lag, of FMI 2.0."""
    two = [drive(motor(tmp_path)), drive(motor(tmp_path, 2), "cart 1", parameters=NUMBERS | {"T": 0.1}, name="slow")]
    sol = mbdae.solve(cart(*two, joints=2), (0, END), step=STEP / 2)
    np.testing.assert_allclose([sol.q[-1, 0], sol.v[-1, 0]], discrete()[0], rtol=1e-10)
    np.testing.assert_allclose([sol.q[-1, 1], sol.v[-1, 1]], discrete(0.1)[0], rtol=1e-10)


def test_instances_are_freed(tmp_path):
    path = motor(tmp_path)
    state = path.stat()
    folder = instance._folder(path.resolve(), state.st_mtime_ns, state.st_size)
    library = ctypes.CDLL(f"{folder}/binaries/{instance.fmpy_module().platform_tuple}/motor.so")
    living = ctypes.c_int.in_dll(library, "living")
    m = cart(drive(path))
    for _ in range(3):
        mbdae.solve(m, (0, 0.1), step=STEP)
    assert living.value == 1  # of the idle workspace
    del m
    gc.collect()
    assert living.value == 0


@pytest.mark.native
def test_the_core_only_calls_at_instants(tmp_path, monkeypatch):
    """100 samples and 1000 steps in a few calls of the core."""
    from mbdae.mechanism.formulations.compiled_systems import CompiledSystem

    calls, advance = [], CompiledSystem.advance
    monkeypatch.setattr(CompiledSystem, "advance", lambda self, *args: (calls.append(0), advance(self, *args))[1])
    sol = mbdae.solve(cart(drive(motor(tmp_path))), (0, 2), step=2e-3)
    assert sol.stats["steps"] == 1000
    assert len(calls) <= 10


def test_a_mechanism_file_names_an_fmu_beside_it(tmp_path):
    motor(tmp_path, name="motor.fmu")
    (tmp_path / "cart.toml").write_text(FILE)
    m = mbdae.load(tmp_path / "cart.toml")
    sol = mbdae.solve(m, (0, END), step=STEP / 2)
    np.testing.assert_allclose([sol.q[-1, 0], sol.v[-1, 0]], discrete()[0], rtol=1e-10)
    values = {"force.motor.parameters.kp": [KP, 2 * KP]}
    runs = mbdae.sweep(tmp_path / "cart.toml", values, t_span=END, outputs=["final q.cart 0"], step=STEP / 2)
    first, second = (row["final q.cart 0"] for row in runs.rows)
    assert first == pytest.approx(sol.q[-1, 0], rel=1e-12)
    assert abs(second - first) > 0.01


FILE = f"""
[[body]]
name = "cart 0"
parent = "world"
joint = "prismatic"
axis = [1, 0, 0]
mass = {MASS}
inertia = [0.01, 0.01, 0.01, 0, 0, 0]
[start.q]
"cart 0" = 0.3
[start.v]
"cart 0" = 1.0
[[force]]
kind = "fmu"
name = "motor"
file = "motor.fmu"
step = {STEP}
inputs = {{ angle = "q.cart 0", speed = "v.cart 0" }}
outputs = {{ torque = "cart 0" }}
parameters = {{ kp = {KP}, kd = {KD}, T = {LAG}, reference = {REFERENCE} }}
"""


@pytest.mark.native
def test_a_mechanism_of_ours_as_the_motor_of_another(tmp_path):
    """An exported crank whose angle is the force on a cart: its signals at the instants, and the motion they cause."""
    unit = mbdae.export("slider_crank", tmp_path / "crank.fmu", kind="cs", outputs=["q.crank"], step=STEP / 4)
    m = cart(FMU(file=str(unit.path), step=STEP, outputs={"q.crank": "cart 0"}, name="crank"))
    sol = mbdae.solve(m, (0, END), step=STEP / 2)
    simulator, (x, v) = mbdae.Simulator("slider_crank", step=STEP / 4), (0.3, 1.0)
    for k in range(round(END / STEP)):
        a = simulator.signals("q.crank")[0] / MASS
        at = np.flatnonzero(np.abs(sol.t - k * STEP) < 1e-9)[-1]
        np.testing.assert_allclose(sol.s[at, 0], a * MASS, rtol=1e-12)
        x, v = x + v * STEP + a * STEP**2 / 2, v + a * STEP
        simulator.advance(STEP)
    np.testing.assert_allclose([sol.q[-1, 0], sol.v[-1, 0]], [x, v], rtol=1e-11)
