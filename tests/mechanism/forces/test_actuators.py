"""Actuators and controllers against independent integrations of equations derived by hand."""

import numpy as np
import pinocchio as pin
import pytest
from links import arm, hinge
from scipy.integrate import solve_ivp
from shared import shared_model

import mbdae
from mbdae import Actuator, DCMotor, Function, JointPID, Sampled
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Harmonic

R, L, K, N = 2.0, 0.05, 0.1, 5.0  # ohm, H, N m/A, gear


def reference(rate, y0, t_end, **settings):
    return solve_ivp(rate, (0, t_end), y0, method="DOP853", rtol=1e-13, atol=1e-13, **settings)


@pytest.mark.slow
@pytest.mark.usefixtures("back_end")
def test_dc_motor_on_a_link():
    wave = Harmonic(amplitude=6.0, omega=4.0, offset=3.0)
    numbers = {"resistance": R, "inductance": L, "constant": K, "gear": N, "current": 0.2}
    motor = DCMotor(joint="arm", voltage=wave, **numbers, name="motor")

    def rate(t, y):
        x, v, i = y
        return [v, hinge(x, N * K * i), (3 + 6 * np.sin(4 * t) - R * i - K * N * v) / L]

    mech = arm(motor)
    assert mech.states == {"motor.current": 0.2}
    end = reference(rate, [0.3, 1.0, 0.2], 1.0).y[:, -1]
    for settings in ({"rtol": 1e-11}, {"step": 1 / 400}, {"rtol": 1e-10, "method": "herk5"}):
        sol = mbdae.solve(mech, (0, 1), **settings)
        assert sol.s.shape == (len(sol.t), 1)
        np.testing.assert_allclose([*sol.q[-1], *sol.v[-1], *sol.s[-1]], end, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.usefixtures("back_end")
def test_dc_motor_without_inductance_is_the_limit():
    ends = []
    for inductance in (0.0, 1e-5, 2e-5):  # stiff: the current follows within 5 microseconds
        motor = DCMotor(joint="arm", voltage=5.0, resistance=R, inductance=inductance, constant=K, gear=N)
        sol = mbdae.solve(arm(motor), (0, 0.2), rtol=1e-11, method="radau5")
        assert sol.stats["steps"] < 1000
        ends.append(sol.q[-1, 0])
    assert abs(ends[1] - ends[0]) < 1e-5
    assert (ends[2] - ends[0]) / (ends[1] - ends[0]) == pytest.approx(2, rel=0.01)


@pytest.mark.usefixtures("back_end")
def test_speed_controller_with_an_integral():
    pi = JointPID(joint="arm", kp=2.0, ki=5.0, controls="velocity", reference=1.5, integral=-0.1)

    def rate(t, y):
        x, v, s = y
        return [v, hinge(x, 2 * (1.5 - v) + 5 * s), 1.5 - v]

    sol = mbdae.solve(arm(pi), (0, 3), rtol=1e-11)
    end = reference(rate, [0.3, 1.0, -0.1], 3.0).y[:, -1]
    np.testing.assert_allclose([*sol.q[-1], *sol.v[-1], *sol.s[-1]], end, rtol=1e-9, atol=1e-9)


@pytest.mark.usefixtures("back_end")
def test_pid_to_a_moving_reference():
    pid = JointPID(joint="arm", kp=20.0, ki=8.0, kd=2.0, reference=Function(function=np.sin, rate=np.cos))

    def rate(t, y):
        x, v, s = y
        return [v, hinge(x, 20 * (np.sin(t) - x) + 8 * s + 2 * (np.cos(t) - v)), np.sin(t) - x]

    sol = mbdae.solve(arm(pid), (0, 3), rtol=1e-11)
    end = reference(rate, [0.3, 1.0, 0.0], 3.0).y[:, -1]
    np.testing.assert_allclose([*sol.q[-1], *sol.v[-1], *sol.s[-1]], end, rtol=1e-9, atol=1e-9)


@pytest.mark.usefixtures("back_end")
def test_python_actuator_is_the_ready_one():
    ready = DCMotor(joint="arm", voltage=5.0, resistance=R, inductance=L, constant=K, gear=N, name="m")
    python = Actuator(
        lambda t, q, v, s: N * K * s,
        lambda t, q, v, s: (5.0 - R * s - K * N * v) / L,
        start={"current": 0.0},
        name="m",
    )
    a, b = (mbdae.solve(arm(x), (0, 1), step=0.01) for x in (ready, python))
    assert a.mechanism.states == b.mechanism.states
    np.testing.assert_allclose(a.y, b.y, rtol=1e-12, atol=1e-14)


def drive():
    """A four-bar driven by a motor whose voltage is filtered by a Python actuator with two states."""

    def rate(t, q, v, s):
        return np.array([s[1], 40 * (np.sin(3 * t) - s[0]) - 4 * s[1] - v[0]])

    shaper = Actuator(lambda t, q, v, s: np.array([0.5 * s[0], 0.0, 0.1 * s[1]]), rate, {"x": 0.1, "dx": 0.0}, "shaper")
    motor = DCMotor(joint="crank", voltage=6.0, resistance=1.0, inductance=0.1, constant=0.4, gear=2.0, name="motor")
    return mbdae.load("four_bar", forces=[motor, shaper])


TIMES = np.linspace(0.05, 0.5, 10)


def at_times(sol):
    return np.array([sol.y[np.argmin(np.abs(sol.t - t))] for t in TIMES])


@pytest.fixture(scope="module")
def exact():
    """The driven four-bar at common times, by scipy's DOP853 on the acceleration form; steps end at the times."""
    settings = {"method": "DOP853", "formulation": "index1", "rtol": 1e-13, "atol": 1e-15}
    return at_times(mbdae.solve(drive(), (0, 0.5), jumps=TIMES, **settings))


STARTS = {"pherk5": 20, "herk5": 20, "herk3": 40, "hedop5": 20, "pherk6": 10, "radau5": 10}


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("method", "n"), STARTS.items())
def test_full_order_in_the_states(method, n, exact):
    """Observed orders of q, v, s and the work."""
    mech, errors = drive(), []
    for steps in (n, 2 * n, 4 * n):
        gap = np.abs(at_times(mbdae.solve(mech, (0, 0.5), method=method, step=0.5 / steps)) - exact).max(axis=0)
        errors.append([gap[:3].max(), gap[3:6].max(), gap[6:9].max(), gap[9]])
    slopes = np.log2(np.array(errors[0]) / np.array(errors[-1])) / 2
    assert (slopes > mbdae.METHODS[method].order_linear - 0.2).all(), (slopes, errors)


@pytest.mark.usefixtures("back_end")
def test_all_formulations_agree():
    mech = drive()
    ref = mbdae.solve(mech, (0, 0.2), method="pherk6", rtol=1e-12)
    for settings in (
        {"formulation": "ggl"},
        {"project": True},
        {"formulation": "index1", "method": "RK45", "atol": 1e-11},
        {"method": "herk4"},
        {"method": "radau5"},
        {"method": "radau5", "formulation": "ggl"},
    ):
        sol = mbdae.solve(mech, (0, 0.2), rtol=1e-9, **settings)
        np.testing.assert_allclose(sol.y[-1], ref.y[-1], atol=1e-6, err_msg=str(settings))


@pytest.mark.usefixtures("back_end")
def test_states_between_steps():
    """Dense output is continuous in s and of the order of v."""
    mech, t = drive(), np.linspace(0.05, 0.45, 37)
    ref = mbdae.solve(mech, (0, 0.5), method="pherk6", rtol=1e-12)
    exact = np.array([ref.point(x) for x in t])
    errors = []
    for n in (50, 100, 200):
        sol = mbdae.solve(mech, (0, 0.5), step=1 / n)
        errors.append(np.abs(np.array([sol.point(x) for x in t]) - exact)[:, 6:9].max())
        i = n // 6
        np.testing.assert_allclose(sol.dense(i)(1.0), sol.y[i + 1], rtol=1e-12, atol=1e-14)
    assert np.log2(errors[0] / errors[-1]) / 2 > 3.8


@pytest.mark.usefixtures("back_end")
def test_states_count_in_the_error_control():
    """An uncoupled state, s' = cos(50 t), is computed to the tolerance, too."""
    swing = Actuator(lambda t, q, v, s: 0 * v, lambda t, q, v, s: np.cos([50 * t]), {"x": 0.0}, "swing")
    sol = mbdae.solve(mbdae.load("pendulum", forces=[swing]), (0, 2), rtol=1e-8)
    np.testing.assert_allclose(sol.s[:, 0], np.sin(50 * sol.t) / 50, atol=1e-8)
    assert sol.stats["steps"] > 2 * mbdae.solve(shared_model("pendulum"), (0, 2), rtol=1e-8).stats["steps"]


def test_saved_runs_keep_the_states(tmp_path):
    sampled = Sampled(lambda t, q, v: -v[:1], rate=20.0, joints="crank", name="brake")
    mech = mbdae.load("four_bar", forces=[sampled, drive().forces[0], drive().forces[1]])
    for made in (mech, mbdae.Mechanism(mech.model, mech.closures, mech.forces, start=mech.start_values)):
        sol = mbdae.solve(made, (0, 0.3))
        sol.save(tmp_path / "run.npz")
        again = mbdae.Solution.load(tmp_path / "run.npz")
        assert list(again.mechanism.states) == list(made.states)
        np.testing.assert_array_equal(again.s, sol.s)
        assert again.s.shape[1] == 4
        assert mbdae.drift(again).energy_error == mbdae.drift(sol).energy_error
        with pytest.raises(InputError, match=r"'(brake|shaper)' is a Python function and not in the file"):
            _ = again.lam


WRONG = [
    (lambda: Actuator(print, print, {}), "has no states"),
    (lambda: Actuator(print, print, {"x": np.nan}, "a"), "states of 'a' start from"),
    (lambda: Actuator(print, print, [0.0], "a"), "states of 'a' start from"),
    *((lambda x=x: Actuator(print, print, {"x": x}, "a"), "states of 'a' start from") for x in (True, 1j, 10**400)),
    (lambda: Sampled(print, rate=0), "needs a rate > 0"),
    (lambda: Sampled(print, rate=1, joints=["a", "b", "a"], name="c"), "controller 'c': joint 'a' is listed twice"),
    (lambda: Sampled(print, rate=1, joints=[], name="c"), "controller 'c': at least one joint is needed"),
    (lambda: Sampled(print, rate=1, joints=3, name="c"), "joints of controller 'c' are names, got 3"),
    (lambda: Sampled(print, rate=10, memory={"x": "y"}), "start from"),
]


@pytest.mark.parametrize(("make", "words"), WRONG)
def test_wrong_arguments(make, words):
    with pytest.raises(InputError, match=words):
        make()


FAILING = {
    "torque of actuator 'a' returned shape": Actuator(lambda *y: np.ones(5), lambda t, q, v, s: s, {"x": 0}, "a"),
    "rate of actuator 'a' returned": Actuator(lambda t, q, v, s: 0 * v, lambda t, q, v, s: s + np.nan, {"x": 0.0}, "a"),
    "torque of actuator 'a' returned ['1']": Actuator(lambda *y: ["1"], lambda t, q, v, s: s, {"x": 0.0}, "a"),
    "controller 'c' returned [True]": Sampled(lambda t, q, v: [True], rate=5, name="c"),
    "controller 'c' returned shape": Sampled(lambda t, q, v: np.ones(7), rate=5, name="c"),
    "controller 'c' with a memory returns": Sampled(lambda t, q, v, x: -v, rate=5, memory={"x": 0}, name="c"),
    "controller 'c', its memory, returned": Sampled(lambda t, q, v, x: (-v, [1, 2]), rate=5, memory={"x": 0}, name="c"),
    "controller 'c' failed": Sampled(lambda t, q, v: v["x"], rate=5, name="c"),
}


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("words", "force"), FAILING.items())
def test_functions_that_fail_are_named(words, force):
    try:
        sol = mbdae.solve(arm(force), (0, 1))
        message = sol.message
        assert sol.status in ("nonfinite", "force")
    except InputError as e:
        message = str(e)
    assert words in message


def test_names_of_laws_with_states_differ():
    motors = [DCMotor(joint="arm", voltage=1, resistance=1, inductance=1, constant=1, name="m") for _ in range(2)]
    with pytest.raises(InputError, match="need different names, got m, m"):
        arm(*motors)
    with pytest.raises(InputError, match=r"s has shape \(2,\), expected \(1,\)"):
        mbdae.solve(arm(motors[0]), (0, 1), s=[1.0, 2.0])


def test_joints_that_do_not_fit_are_rejected_with_the_name_of_what_acts():
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(j, pin.Inertia.Random(), pin.SE3.Identity())
    spring = mbdae.JointSpring(name="hold", joint="wheel", stiffness=1)
    for force in (JointPID(name="hold", joint="wheel"), spring):
        with pytest.raises(InputError, match=r"joint_(pid|spring) 'hold'.* needs a joint of one coordinate; 'wheel'"):
            mbdae.Mechanism(model, forces=[force])
