"""Outputs of FMUs that set inputs of forces and drivers: against exact discrete systems and a simulator."""

import numpy as np
import pytest
from motors import motor
from test_fmu_motion import END, MASS, NUMBERS, REFERENCE, STEP, cart, drive
from valves import FREE, KEEP, SLOW, at_instants, cylinder, driven, exact, valve

import mbdae
from mbdae import DCMotor, Input, JointPID, JointTorque

SETTINGS = {"step": STEP / 4, "method": "pherk6"}
R, L, K = 0.5, 0.02, 0.4  # ohm, H, V s/m
SOFT = {"kp": 0.05, "kd": 0.01}


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("version", [2, 3])
def test_a_valve_and_a_cylinder(hold, version, back_end, tmp_path):
    sol = mbdae.solve(cylinder(motor(tmp_path, version), hold), (0, END), **SETTINGS)
    assert sol.stats["backend"] == back_end
    np.testing.assert_allclose(at_instants(sol, sol.y[:, :2]), exact(*FREE, hold, [0.3, 1.0]), rtol=1e-12, atol=1e-12)
    assert mbdae.drift(sol).energy_relative < 1e-12


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_a_controller_and_the_voltage_of_a_motor(hold, back_end, tmp_path):
    """x = (position, speed, current): the current is a state of the motor, the voltage an input."""
    electric = DCMotor(
        joint="cart 0", voltage=Input(name="valve", hold=hold, value=1.5), resistance=R, inductance=L, constant=K,
        name="spin",
    )  # fmt: skip
    sol = mbdae.solve(cart(electric, valve(motor(tmp_path))), (0, END), step=STEP / 16, method="pherk6")
    A = np.array([[0, 1, 0], [0, 0, K / MASS], [0, -K / L, -R / L]])
    assert sol.stats["backend"] == back_end
    found = np.column_stack([sol.y[:, :2], sol.signals()["s.spin.current"]])
    expected = exact(A, np.array([0, 0, 1 / L]), hold, [0.3, 1.0, 0.0])
    np.testing.assert_allclose(at_instants(sol, found), expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("rate", [None, 1 / STEP])
def test_the_reference_of_a_controller(rate, back_end, tmp_path):
    """A PD controller, continuous or sampled, with the output of the valve as its reference."""
    pd = JointPID(joint="cart 0", kp=50.0, kd=8.0, reference=Input(name="valve", value=1.5), rate=rate)
    sol = mbdae.solve(cart(valve(motor(tmp_path), parameters=NUMBERS | SLOW), pd), (0, END), step=STEP / 16)
    assert sol.stats["backend"] == back_end
    A, b = (np.array([[0, 1], [-50 / MASS, -8 / MASS]]), np.array([0, 50 / MASS])) if rate is None else FREE
    expected = exact(A, b, "zero", [0.3, 1.0], **SLOW) if rate is None else sampled_exact()
    np.testing.assert_allclose(at_instants(sol, sol.y[:, :2]), expected, rtol=1e-10, atol=1e-11)


def sampled_exact():
    """The controller of the file takes the reference of just before the instant."""
    x, state, demand, u, out = np.array([0.3, 1.0]), 0.0, None, 1.5, []
    for _ in range(round(END / STEP) + 1):
        out.append(x)
        force = 50 * (u - x[0]) - 8 * x[1]
        u = state = 0.0 if demand is None else KEEP * state + (1 - KEEP) * demand
        demand = SLOW["kp"] * (REFERENCE - x[0])
        x = np.array([x[0] + x[1] * STEP + force / MASS * STEP**2 / 2, x[1] + force / MASS * STEP])
    return np.array(out)


def test_the_speed_of_a_driver_is_linear_in_each_step(back_end, tmp_path):
    """q' = u, and the force of the driver is MASS u'."""
    sol = mbdae.solve(driven(motor(tmp_path)), (0, END), **SETTINGS)
    expected = exact(np.zeros((1, 1)), np.array([1.0]), "first", [0.3], 1.0, **SLOW)
    assert sol.stats["backend"] == back_end
    np.testing.assert_allclose(at_instants(sol, sol.q), expected, rtol=1e-12)
    rate = sol.signals()["s.motor.rate valve"]
    np.testing.assert_allclose(sol.lam[:, 0], MASS * rate, rtol=1e-9, atol=1e-12)
    inner = (at_instants(sol, sol.v[:, 0])[1:] - at_instants(sol, sol.v[:, 0], after=True)[:-1]) / STEP
    np.testing.assert_allclose(inner, at_instants(sol, rate, after=True)[:-1], rtol=1e-10, atol=1e-12)
    assert np.abs(np.diff(sol.v[:, 0])).max() < 0.3 * np.abs(sol.v).max()
    assert not sol.impacts


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("kind", [{"step": STEP / 4}, {"rtol": 1e-9}])
def test_a_closed_loop_and_a_simulator_whose_input_a_user_sets(hold, kind, back_end, tmp_path):
    """The same controller written here, around `mbdae.Simulator`."""
    torque = JointTorque(joint="crank", torque=Input(name="valve", hold=hold))
    numbers = {"inputs": {"angle": "q.crank", "speed": "v.crank"}, "parameters": NUMBERS | SOFT}
    m = mbdae.load("slider_crank", forces=[torque, valve(motor(tmp_path), **numbers)])
    sol = mbdae.solve(m, (0, END), **kind)
    assert sol.stats["backend"] == back_end
    simulator = mbdae.Simulator(mbdae.load("slider_crank", forces=[torque]), **kind)
    state, demand = 0.0, None
    for k in range(round(END / STEP)):
        state = 0.0 if demand is None else KEEP * state + (1 - KEEP) * demand
        at, speed = simulator.signals("q.crank", "v.crank")
        demand = SOFT["kp"] * (REFERENCE - at) - SOFT["kd"] * speed
        simulator["valve"] = state
        simulator.advance((k + 1) * STEP - simulator.t)
    rtol = 1e-11 if "step" in kind else 1e-6
    np.testing.assert_allclose(sol.y[-1, :6], simulator._y[:6], rtol=rtol)
    lam = simulator.solution().lam[-1]
    np.testing.assert_allclose(sol.lam[-1], lam, rtol=rtol, atol=rtol * np.abs(lam).max())


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_signals_just_before_an_instant_belong_to_the_input_until_then(hold, tmp_path):
    """A second FMU measures the acceleration, u / MASS, and holds it: its number is that of the run before the jump."""
    path, numbers = motor(tmp_path), {"kp": 0, "gain": 0, "feed": 1.0}
    probe = drive(path, inputs={"speed": "a.cart 0"}, outputs={"torque": "seen"}, parameters=numbers, name="probe")
    weak = JointTorque(joint="cart 0", torque=Input(name="seen"))
    push = JointTorque(joint="cart 0", torque=Input(name="valve", hold=hold))
    sol = mbdae.solve(cart(push, valve(path), probe, weak), (0, END), **SETTINGS)
    before = at_instants(sol, sol.signals()["a.cart 0"])
    after = at_instants(sol, sol.signals()["s.probe.input seen"], after=True)
    np.testing.assert_allclose(after[1:-1], before[1:-1], rtol=1e-10, atol=1e-12)
    assert np.ptp(before) > 1.0
