"""Sampled controllers, and jumps given by the user, against integrations interval by interval."""

import numpy as np
import pytest
from links import arm, hinge
from scipy.integrate import solve_ivp

import mbdae
from mbdae import DCMotor, JointPID, Sampled
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Steps
from mbdae.studies.comparison.reference_motion import ReferenceMotion
from mbdae.studies.order.measurement import Measurement


def piecewise(t_end, period, sample, y0, memory=0.0):
    """The link with a torque held from sample to sample, each interval integrated separately."""
    y, out, k = np.array(y0), [], 0
    while k * period < t_end - 1e-12:
        tau, memory = sample(k * period, *y, memory)
        out.append((y, tau, memory))
        span = (k * period, min((k + 1) * period, t_end))
        y = solve_ivp(lambda t, y: [y[1], hinge(y[0], tau)], span, y, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]  # noqa: B023
        k += 1
    return y, out


RATES = [10.0, 7.0, 1 / 0.3]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("settings", [{"rtol": 1e-10}, {"step": 1 / 300}, {"rtol": 1e-10, "first_step": 1.0}])
def test_sampled_controller(rate, settings):
    brake = Sampled(lambda t, q, v: -3 * v - 8 * (q - np.sin(t)), rate=rate, name="brake")
    sol = mbdae.solve(arm(brake), (0, 2), method="pherk6", **settings)
    end, pieces = piecewise(2.0, 1 / rate, lambda t, x, v, m: (-3 * v - 8 * (x - np.sin(t)), m), [0.3, 1.0])
    np.testing.assert_allclose([*sol.q[-1], *sol.v[-1]], end, rtol=1e-9)
    instants = np.arange(len(pieces)) / rate
    assert np.isin(instants, sol.t).all()
    for t, (y, tau, _) in zip(instants, pieces, strict=True):
        i = int(np.flatnonzero(sol.t == t)[0])
        np.testing.assert_allclose([*sol.q[i], *sol.v[i], *sol.s[i]], [*y, tau], rtol=1e-8)
        held = sol.s[(sol.t >= t) & (sol.t < t + 0.999 / rate)]
        assert (held == held[0]).all()
    if settings.get("first_step"):
        assert sol.stats["rejected"] > 0


@pytest.mark.usefixtures("back_end")
def test_sampled_pid_with_memory():
    pid = JointPID(joint="arm", kp=20.0, ki=8.0, kd=2.0, reference=0.5, rate=25.0, integral=0.05, name="pid")

    def sample(t, x, v, m):
        return 20 * (0.5 - x) + 8 * m - 2 * v, m + (0.5 - x) / 25

    def python(t, q, v, m):
        return [20 * (0.5 - q[0]) + 8 * m[0] - 2 * v[0]], m + (0.5 - q) / 25

    end, pieces = piecewise(1.0, 1 / 25, sample, [0.3, 1.0], 0.05)
    again = Sampled(python, rate=25.0, memory={"integral": 0.05}, name="pid")
    for controller in (pid, again):
        mech = arm(controller)
        assert mech.states == {"pid.torque arm": 0.0, "pid.integral": 0.05}
        sol = mbdae.solve(mech, (0, 1), rtol=1e-11)
        np.testing.assert_allclose([*sol.q[-1], *sol.v[-1]], end, rtol=1e-9)
        np.testing.assert_allclose(sol.s[-1], [pieces[-1][1], pieces[-1][2]], rtol=1e-9)


@pytest.mark.usefixtures("back_end")
def test_a_sampled_run_goes_on_from_any_state():
    """The state is complete: two runs in a row equal one run; the torque is held across the junction."""
    mech = arm(Sampled(lambda t, q, v, x: (-3 * v + x, 0.5 * x + 1), rate=10.0, memory={"x": 0.0}))
    whole = mbdae.solve(mech, (0, 1), rtol=1e-11)
    # between two instants, and at one: it samples when the second run starts, and before if the first one ends later
    for middle in (0.55, 0.5, 0.5 - 1e-15, 0.5 + 1e-11, 0.5 + 1e-14):
        first = mbdae.solve(mech, (0, middle), rtol=1e-11)
        second = mbdae.solve(mech, (middle, 1), first.q[-1], first.v[-1], first.s[-1], rtol=1e-11)
        np.testing.assert_allclose(second.y[-1, :-1], whole.y[-1, :-1], rtol=1e-9)


def test_all_formulations_sample():
    """A four-bar with a sampled brake and a motor: every family of methods crosses the same jumps."""
    brake = Sampled(lambda t, q, v: -2 * v[:1], rate=7.0, joints="crank", name="brake")
    motor = DCMotor(joint="crank", voltage=6.0, resistance=1.0, inductance=0.1, constant=0.4, name="motor")
    mech = mbdae.load("four_bar", forces=[brake, motor])
    ref = mbdae.solve(mech, (0, 1), method="pherk6", rtol=1e-12)
    for settings in (
        {"formulation": "ggl"},
        {"project": True},
        {"formulation": "index1", "method": "DOP853"},
        {"method": "radau5"},
        {"method": "herk5"},
    ):
        sol = mbdae.solve(mech, (0, 1), rtol=1e-9, atol=1e-11, **settings)
        np.testing.assert_allclose(sol.y[-1], ref.y[-1], atol=1e-6, err_msg=str(settings))
        assert np.isin(np.arange(7) / 7.0, sol.t).all()
        again = mbdae.solve(mech, (0, 1), rtol=1e-9, atol=1e-11, **settings)
        np.testing.assert_array_equal(again.y, sol.y)


@pytest.mark.slow
@pytest.mark.usefixtures("back_end")
def test_events_between_and_at_jumps():
    brake = Sampled(lambda t, q, v: -6 * v, rate=8.0, name="brake")
    sol = mbdae.solve(arm(brake), (0, 3), rtol=1e-9, events=[lambda t, q, v: t - 0.375, lambda t, q, v: q[0] - 1.2])
    (at, _), (when, _) = sol.events
    assert at == pytest.approx([0.375])
    assert [float(sol(t).q[0]) for t in when] == pytest.approx([1.2] * len(when))
    ended = mbdae.solve(arm(brake), (0, 3), rtol=1e-9, events=mbdae.Event(lambda t, q, v: t - 1.0, terminal=True))
    assert ended.t[-1] == pytest.approx(1.0)
    assert (np.diff(ended.t) > 0).all()
    assert ended.status == "event"


def test_rates_beyond_rounding_are_rejected():
    sol = mbdae.solve(arm(JointPID(joint="arm", kp=1.0, rate=1e300)), (0, 1))
    assert sol.status == "step_size"
    assert "jumps follow one another too closely" in sol.message


def test_jumps_within_roundings_are_one():
    times = [0.1, np.nextafter(0.1, 1), 0.3, 0.1 + 0.2, 0.25, 1.0, 0.0]
    sol = mbdae.solve(arm(Sampled(lambda t, q, v: -v, rate=10.0)), (0, 1), jumps=times)
    crossed = sol.t[1:][np.diff(sol.t) < 1e-12]
    np.testing.assert_allclose(crossed, [0.1, 0.2, 0.25, *np.arange(3, 10) / 10], rtol=1e-15)
    assert sol.t[-1] == 1.0
    assert sol.stats["steps"] == len(sol.t) - 1 - len(crossed)


def test_sampled_controllers_run_forwards():
    with pytest.raises(InputError, match="'brake' is sampled: a run with it cannot go backwards"):
        mbdae.solve(arm(Sampled(lambda t, q, v: -v, rate=10, name="brake")), (1, 0))


@pytest.mark.usefixtures("back_end")
def test_two_rates_and_an_actuator_between():
    """A sampled set point, held, drives a motor; each law uses the states before the jump."""
    slow = Sampled(lambda t, q, v: -v, rate=4.0, name="slow")
    fast = Sampled(lambda t, q, v: -2 * q, rate=12.0, offset=0.25, name="fast")
    motor = DCMotor(joint="arm", voltage=2.0, resistance=2.0, inductance=0.05, constant=0.1, name="motor")
    sol = mbdae.solve(arm(slow, fast, motor), (0, 1), rtol=1e-10)
    instants = np.unique(np.round(np.concatenate([np.arange(4) / 4, 0.25 + np.arange(-3, 9) / 12]), 12))
    crossed = sol.t[1:][np.diff(sol.t) < 1e-12]
    np.testing.assert_allclose(crossed, instants[instants > 0], atol=1e-14)
    assert mbdae.drift(sol).energy_relative < 1e-9


def test_what_is_read_at_a_step_is_of_that_step():
    """At a jump two points are a few roundings apart, the second one after it: torques and multipliers differ."""
    brake = Sampled(lambda t, q, v: -2 * v[:1], rate=7.0, joints="crank", name="brake")
    mech = mbdae.load("four_bar", forces=[brake])
    sol = mbdae.solve(mech, (0, 1), step=1 / 28)
    assert len(sol.t) == 29 + 6
    np.testing.assert_array_equal(list(sol.points(sol.t)), sol.y)
    np.testing.assert_array_equal([sol.point(t) for t in sol.t], sol.y)
    asked = mbdae.solve(mech, (0, 1), step=1 / 28, t_eval=sol.t)
    np.testing.assert_array_equal(asked.y, sol.y)
    np.testing.assert_array_equal(asked.lam_own, sol.lam_own)
    np.testing.assert_allclose(asked.lam, sol.lam, rtol=1e-12, atol=1e-12)
    samples = ReferenceMotion(mech, mech.start, (0.0, 1.0), sol.t[1:], 100).sample(sol)
    np.testing.assert_array_equal(samples["v"], sol.v[1:])
    np.testing.assert_allclose(samples["lam"], sol.lam[1:], rtol=1e-12, atol=1e-12)
    q, _, own, hidden = Measurement(mech, 1.0, 14, None, lambda name: None, "auto").sample(sol)
    after = [np.flatnonzero(np.abs(sol.t - k / 14) < 1e-12)[-1] for k in range(1, 15)]
    np.testing.assert_array_equal(q, sol.q[after])
    np.testing.assert_array_equal(own, sol.lam_own[after])
    np.testing.assert_allclose(hidden, sol.lam[after], rtol=1e-12, atol=1e-12)


@pytest.mark.usefixtures("back_end")
def test_jumps_of_a_python_force():
    """With its jump times given, a force of t keeps the full order; the same as a function that knows its jumps."""
    times, values = (0.31, 0.77), (2.0, -4.0, 1.0)

    def push(t, q, v):
        return np.array([values[int(np.searchsorted(times, t, side="right"))]])

    steps = mbdae.JointTorque(joint="arm", torque=Steps(points=((0.0, 2.0), (0.31, -4.0), (0.77, 1.0))))
    y, t = [0.3, 1.0], 0.0
    for until, tau in zip((*times, 1.0), values, strict=True):
        y = solve_ivp(lambda t, y: [y[1], hinge(y[0], tau)], (t, until), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]  # noqa: B023, E501
        t = until
    reported, own = mbdae.solve(arm(push), (0, 1), rtol=1e-11, jumps=times), mbdae.solve(arm(steps), (0, 1), rtol=1e-11)
    np.testing.assert_allclose([*reported.q[-1], *reported.v[-1]], y, rtol=1e-10)
    np.testing.assert_array_equal(reported.y, own.y)
    errors = [abs(mbdae.solve(arm(push), (0, 1), step=1 / n, jumps=times).q[-1, 0] - y[0]) for n in (10, 20, 40)]
    assert errors[-1] < 1e-8
    assert np.log2(errors[0] / errors[-1]) / 2 > 4.5
    back = mbdae.solve(arm(push), (1, 0), [y[0]], [y[1]], rtol=1e-11, jumps=times)
    np.testing.assert_allclose([*back.q[-1], *back.v[-1]], [0.3, 1.0], rtol=1e-9)
    mid = mbdae.solve(arm(push), (0, 1), rtol=1e-11, jumps=times, t_eval=[0.2, 0.31, 0.5, 1.0])
    np.testing.assert_allclose(mid.v[1], own(0.31).v, rtol=1e-12)


@pytest.mark.parametrize("jumps", [[np.nan], "now", [[1.0]], 3.0])
def test_jumps_are_times(jumps):
    with pytest.raises(InputError, match="jumps is a list of times"):
        mbdae.solve(arm(), (0, 1), jumps=jumps)
