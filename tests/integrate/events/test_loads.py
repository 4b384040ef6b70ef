"""Loads that come and go during rest or stiction, against closed forms: none is missed between two steps."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

import mbdae
from mbdae import Driver, JointFriction, JointTorque, Mechanism, Stop
from mbdae.mechanism.time_functions.time_functions import Harmonic, TimeTable

MASS = 2.0
STEPS = [{"rtol": 1e-6}, {"step": 0.5}, {"step": 3.0}]
PULSE = ((0.0, -1.0), (5.0, -1.0), (5.05, 1.0), (5.1, -1.0), (10.0, -1.0))


def slider(*forces, **more):
    """A slider of 2 kg without gravity."""
    model = empty()
    model.gravity.linear = np.zeros(3)
    add_body(model, 0, pin.JointModelPX(), "x", MASS)
    return Mechanism(model, forces=forces, **more)


def on_stop(torque):
    return slider(JointTorque(joint="x", torque=torque), stops=[Stop(joint="x", lower=0.0)])


def transitions(sol):
    return [float(sol.t[i]) for i, _ in sol.modes[1:]]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("how", STEPS, ids=str)
@pytest.mark.parametrize("amplitude", [1.002, 1.00001])
def test_a_stop_that_is_lifted_by_a_little_for_a_moment(amplitude, how):
    """m x'' = A sin wt - 1 from A sin wt = 1 on, until x = 0."""
    w = 2.0
    lifts = np.arcsin(1 / amplitude) / w
    peak = np.pi / 2 / w

    def way(t):
        d = t - lifts
        fall = amplitude * (np.cos(w * lifts) * d / w - (np.sin(w * t) - np.sin(w * lifts)) / w**2)
        return (fall - d**2 / 2) / MASS

    lands = brentq(way, peak, peak + 5 * (peak - lifts), xtol=1e-15)
    sol = mbdae.solve(on_stop(Harmonic(amplitude=amplitude, omega=w, offset=-1.0)), (0, 0.75 * np.pi), **how)
    assert [m for _, m in sol.modes] == [(1,), (0,), (1,)]
    assert transitions(sol) == pytest.approx([lifts, lands], abs=1e-8)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("how", STEPS, ids=str)
def test_a_pulse_of_a_table_lifts_a_slider_off_its_stop(how):
    force = PchipInterpolator(*np.array(PULSE).T)
    lifts = 5.025  # in the middle of a rise, by symmetry
    speed = force.antiderivative()
    way = speed.antiderivative()

    def gap(t):
        return (way(t) - way(lifts) - speed(lifts) * (t - lifts)) / MASS

    lands = brentq(gap, 5.1, 6, xtol=1e-15)
    sol = mbdae.solve(on_stop(TimeTable(points=PULSE, interpolation="monotone")), (0, 10), **how)
    assert [m for _, m in sol.modes] == [(1,), (0,), (1,)]
    assert transitions(sol) == pytest.approx([lifts, lands], abs=1e-10)


@pytest.mark.usefixtures("back_end")
def test_a_pulse_of_a_table_makes_a_joint_slip():
    force = PchipInterpolator(*np.array(PULSE).T)
    slips = brentq(lambda t: force(t) - 0.9, 5.0, 5.05, xtol=1e-15)
    speed = force.antiderivative()
    rests = brentq(lambda t: speed(t) - speed(slips) - 0.9 * (t - slips), 5.05, 5.09, xtol=1e-15)
    points = tuple((t, 0.5 * (1 + x)) for t, x in PULSE)  # from 0 to 1
    half = 0.5 * (1 + 0.9)
    mech = slider(
        JointTorque(joint="x", torque=TimeTable(points=points, interpolation="monotone")),
        JointFriction(joint="x", friction=half, exact=True),
    )
    for how in STEPS:
        sol = mbdae.solve(mech, (0, 10), **how)
        assert transitions(sol) == pytest.approx([slips, rests], abs=1e-6)  # it slips above the limit by 1e-6


@pytest.mark.usefixtures("back_end")
def test_a_driven_table_that_drops_faster_than_gravity_separates():
    """A motion table that drops by more than g for 0.1 s: the body on it lifts off."""
    model = empty()
    add_body(model, add_body(model, 0, pin.JointModelPZ(), "table"), pin.JointModelPZ(), "block", MASS)
    points = ((0.0, 0.0), (4.0, 0.0), (4.05, -0.02), (4.1, -0.04), (4.2, -0.04), (10.0, -0.04))
    drive = Driver(joint="table", motion=TimeTable(points=points, interpolation="monotone"))
    mech = Mechanism(model, drivers=[drive], stops=[Stop(joint="block", lower=0.0)])
    sol = mbdae.solve(mech, (0, 10), rtol=1e-9)
    falls = PchipInterpolator(*np.array(points).T)
    lets_go = brentq(lambda t: falls(t, 2) + 9.81, 4.0, 4.05, xtol=1e-15) if falls(4.0, 2) > -9.81 else 4.0
    assert transitions(sol)[0] == pytest.approx(lets_go, abs=1e-12)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("parts", [{"stops": [Stop(joint="x", lower=0.0)]}, {}], ids=["rests", "sticks"])
def test_a_load_function_may_jump_at_an_unknown_time(parts):
    """No step resolves it; the run continues after it."""
    held = [] if parts else [JointFriction(joint="x", friction=5.0, exact=True)]
    sol = mbdae.solve(slider(lambda t, q, v: np.array([-1.0 if t < 0.5 else -3.0]), *held, **parts), (0, 2))
    assert sol.status == "finished"
    assert abs(sol.lam[-1, 0]) == pytest.approx(3.0)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("backlash", [1e-3, 1e-9])
def test_a_load_is_passed_on_through_backlash_however_small(backlash, restitution):
    """Momentum equals that of the load for any sequence of impacts, and both bodies end together."""
    model = empty()
    model.gravity.linear = np.zeros(3)
    for name in ("a", "b"):
        add_body(model, 0, pin.JointModelPX(), name, 1.0)
    play = {"joints": ("a", "b"), "coefficients": (0.0, 1.0), "lower": -backlash / 2, "upper": backlash / 2}
    push = JointTorque(joint="a", torque=Harmonic(amplitude=1.0, omega=6.0))
    mech = Mechanism(model, forces=[push], stops=[Stop(restitution=restitution, **play)])
    sol = mbdae.solve(mech, (0, 1), rtol=1e-9)
    assert sol.success
    assert sol.v.sum(axis=1) == pytest.approx((1 - np.cos(6 * sol.t)) / 6, abs=1e-9)
    assert sol.v[-1, 0] == pytest.approx(sol.v[-1, 1], abs=1e-9)
    assert np.abs(sol.q[:, 0] - sol.q[:, 1]).max() < backlash / 2 + 1e-15
    assert mbdae.drift(sol).energy_relative < 1e-9
