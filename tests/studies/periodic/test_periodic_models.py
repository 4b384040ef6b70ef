"""Periodic motions of models: a spinning rattleback, a Geneva drive with a motor."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import mbdae
from mbdae import JointDamping, JointTorque


@pytest.mark.slow
def test_a_rattleback_that_spins_has_neutral_multipliers_and_its_reversal_the_inverse_ones():
    """Time, place, heading and energy are neutral; the equations are reversible: mu(-spin) = 1/mu(spin)."""
    found = {}
    for spin in (5.0, -5.0):
        start = {"q": {"stone": [0, 0, 0.01, 0, 0, 0, 1]}, "v": {"stone": [0, 0, 0, 0, 0, spin]}}
        found[spin] = mbdae.periodic("rattleback", 0.2, symmetry=["x", "y", "turn"], rtol=1e-7, **start)
        assert [x.name for x in found[spin].neutral] == ["time", "x", "y", "turn", "energy"]
        assert max(x.error for x in found[spin].neutral) < 1e-9
        assert found[spin].stability == "unstable"
    against, preferred = (found[spin].multipliers for spin in (5.0, -5.0))
    assert np.abs(against).max() > 1.5 > 1.05 > np.abs(preferred).max()  # in a sixth of a turn
    np.testing.assert_allclose(np.poly(against), np.poly(1 / preferred), rtol=1e-7)


TORQUE, DAMPING = 0.375, 0.05
CRANK, WHEEL = 0.02, 1e-3  # kg m^2


def wheel_ratio(angle):
    """d(wheel)/d(crank) of the pin at r = 0.1/sqrt 2 from the crank, in a slot; 0 on the locking disc."""
    angle = (angle + np.pi) % (2 * np.pi) - np.pi
    if abs(angle) >= np.pi / 4:
        return 0.0
    lam = 1 / np.sqrt(2)
    return lam * (np.cos(angle) - lam) / (1 - 2 * lam * np.cos(angle) + lam**2)


def turn(energy):
    """Energy, time and integral of d/I dt after a turn of the crank from 1 rad before the slot."""
    state = np.array([energy, 0.0, 0.0])
    for first, last in ((-1.0, -np.pi / 4), (-np.pi / 4, np.pi / 4), (np.pi / 4, 2 * np.pi - 1)):

        def rates(angle, y, middle=(first + last) / 2, inside=first == -np.pi / 4):
            inertia = CRANK + WHEEL * (wheel_ratio(angle) ** 2 if inside else 0.0)
            speed = np.sqrt(2 * y[0] / inertia)
            return TORQUE - DAMPING * speed, 1 / speed, DAMPING / inertia / speed

        state = solve_ivp(rates, (first, last), state, rtol=1e-12, atol=1e-14).y[:, -1]
    return state


@pytest.mark.slow
def test_a_geneva_drive_with_a_motor():
    """One degree of freedom: dE/da = torque - d a', mu = exp(-int d/I dt); the wheel turns by a quarter per turn."""
    energy = brentq(lambda e: turn(e)[0] - e, 0.1, 2.0, xtol=1e-14)
    _, T, decay = turn(energy)
    forces = JointTorque(joint="crank", torque=TORQUE), JointDamping(joint="crank", damping=DAMPING)
    mech = mbdae.load("geneva_drive", forces=forces)
    found = mbdae.periodic(mech, 4 * T, v={"crank": np.sqrt(1.99 * energy / CRANK)}, rtol=1e-10)
    assert pytest.approx(4 * T, rel=1e-10) == found.T
    assert found.multipliers.real == pytest.approx([np.exp(-4 * decay), 0.0], rel=1e-6, abs=1e-9)  # and of the wheel
    assert [x.name for x in found.neutral] == ["time"]
    run = found.run
    quarters = run(run.t[0] + found.T * np.arange(5) / 4).q
    np.testing.assert_allclose(np.diff(quarters, axis=0), np.tile([2 * np.pi, -np.pi / 2], (4, 1)), atol=1e-7)
