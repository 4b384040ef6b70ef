"""A ball that bounces once per period of an oscillating table, in closed form.

With the table's speed u and acceleration a at the bounce, v = g T/2 after it and -v before it,

    u = v (1 - e)/(1 + e);   (u + v) dt' = (u + v) dt + T dv,   dv' = (1 + e) a dt' - e (dv - g (dt' - dt))
"""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae import Driver, Mechanism, Stop
from mbdae.mechanism.time_functions.time_functions import Harmonic

G, E, OMEGA = 9.81, 0.8, 2 * np.pi * 5
T = 2 * np.pi / OMEGA
V = G * T / 2
U = V * (1 - E) / (1 + E)


def bounce_time(amplitude, sign):
    """Time of the bounce after the fastest rise, where the speed A omega cos(omega t) falls (1) or rises (-1)."""
    return sign * np.arccos(U / (amplitude * OMEGA)) / OMEGA % T


def ball_on_table(amplitude):
    """The mechanism; the table's height is -A sin(omega t): a period begins half a period after its fastest rise."""
    model, mass = pin.Model(), pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3)))
    for name in ("table", "ball"):
        joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, mass, pin.SE3.Identity())
    stop = Stop(joints=("ball", "table"), coefficients=(0.0, 1.0), lower=0.0, restitution=E, name="bounce")
    driver = Driver(joint="table", motion=Harmonic(amplitude=-amplitude, omega=OMEGA))
    return Mechanism(model, drivers=[driver], stops=[stop])


def start(amplitude, sign):
    """The state (q, v) half a period after the fastest rise."""
    t = bounce_time(amplitude, sign)
    flown = (T / 2 - t) % T
    z = amplitude * np.sin(OMEGA * t) + V * flown - G * flown**2 / 2
    return np.array([0.0, z]), np.array([-amplitude * OMEGA, V - G * flown])


def multipliers(amplitude, sign):
    a, s = -amplitude * OMEGA**2 * np.sin(OMEGA * bounce_time(amplitude, sign)), T / (U + V)
    return np.linalg.eigvals([[1, s], [(1 + E) * a, (1 + E) * a * s - E + E * G * s]])


@pytest.mark.parametrize(("amplitude", "sign"), [(0.012, 1), (0.006, 1), (0.012, -1)])
def test_one_bounce_per_period(amplitude, sign):
    q, v = start(amplitude, sign)
    found = mbdae.periodic(ball_on_table(amplitude), q=q + [0.0, 1e-5], v=v - [0.0, 1e-4], rtol=1e-11)
    assert pytest.approx(T, rel=1e-14) == found.T
    np.testing.assert_allclose(found.q, q, atol=1e-11)
    np.testing.assert_allclose(found.v, v, atol=1e-10)
    expected = multipliers(amplitude, sign)
    for z in expected:
        assert np.abs(found.multipliers - z).min() < 1e-9
    assert found.stability == ("stable" if np.abs(expected).max() < 1 else "unstable")
