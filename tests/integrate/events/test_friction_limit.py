"""Frictional unilateral contacts under loads that reach the friction limit: sliding starts there."""

import numpy as np
import pytest
from bouncing import G
from integrate.events.test_frictional_contacts import GRIPS, SLIDES, R, block

import mbdae
from mbdae import JointTorque
from mbdae.mechanism.time_functions.time_functions import Harmonic

MU, MASS = 0.3, 2.0


def pushed(force):
    mech = block(MU)
    return mbdae.Mechanism(mech.model, mech.closures, [*mech.forces, JointTorque(joint="x", torque=force)])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_block_under_a_force_that_grows_slides_from_the_limit_on(sign):
    """F = k t: at rest until k t = mu m g, and x = k (t - t*)^3/(6 m) afterwards."""
    k = MU * MASS * G / 0.4
    force = mbdae.Function(function=lambda t: sign * k * t, name="ramp")
    sol = mbdae.solve(pushed(force), (0, 1), np.array([0.0, R]), np.zeros(2), rtol=1e-9)
    assert sol.success, sol.message
    assert [m for _, m in sol.modes] == [(GRIPS,), (SLIDES,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx(0.4, abs=1e-8)
    assert sol.q[-1] == pytest.approx([sign * k * 0.6**3 / 6 / MASS, R], abs=1e-8)
    assert sol.v[-1] == pytest.approx([sign * k * 0.6**2 / 2 / MASS, 0], abs=1e-8)
    assert not len(sol.impacts)


def test_a_block_under_an_oscillating_force_slides_and_sticks():
    """m v' = A sin(w t) - mu m g from the time at which the force reaches the limit, until v = 0."""
    amplitude, omega = 1.5 * MU * MASS * G, 5.0
    sol = mbdae.solve(
        pushed(Harmonic(amplitude=amplitude, omega=omega)), (0, 0.6), np.array([0.0, R]), np.zeros(2), rtol=1e-9
    )
    assert sol.success, sol.message
    start = np.arcsin(1 / 1.5) / omega
    assert [m for _, m in sol.modes[:2]] == [(GRIPS,), (SLIDES,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx(start, abs=1e-8)

    def speed(t):
        return amplitude / MASS / omega * (np.cos(omega * start) - np.cos(omega * t)) - MU * G * (t - start)

    for t in np.linspace(start, 0.5, 7):
        assert sol(t).v[0] == pytest.approx(speed(t), abs=1e-7)
