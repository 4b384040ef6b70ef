"""Kinematics and inverse dynamics take flexible bodies as rigid: modes are held, and their reactions do no work."""

import numpy as np
import pytest
from flexible_bodies import FOUR_BAR
from scipy.interpolate import CubicSpline

import mbdae
from mbdae import inverse_dynamics, kinematics
from mbdae.errors import InputError

SPEED, BEAM = 8.0, 7850.0 * 64e-6 * 0.9  # rad/s, kg
MODES = [f"coupler.mode {i}" for i in range(1, 5)]


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load(FOUR_BAR)


@pytest.fixture(scope="module")
def curve(four_bar):
    return kinematics(four_bar, "crank", span=(0.5, 2.5), points=81)


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def energy(u, q):
    """Energy in J of the rigid linkage at a constant speed of the crank: rates by splines over its angle."""
    crank, coupler, rocker = q[:, 0], q[:, 0] + q[:, 1], q[:, 6]
    middle = 0.3 * unit(crank) + 0.45 * unit(coupler)
    v_middle, w_coupler, w_rocker = (SPEED * CubicSpline(u, x.T)(u, 1).T for x in (middle, coupler, rocker))
    kinetic = (0.5 * 0.3**2 / 4 + 0.00375) * SPEED**2 + (1.0 * 0.35**2 + 0.04083333333333333) * w_rocker**2
    kinetic += BEAM * (v_middle**2).sum(0) + BEAM * 0.9**2 / 12 * w_coupler**2
    heights = 0.5 * 0.15 * np.sin(crank) + 1.0 * 0.35 * np.sin(rocker) + BEAM * middle[1]
    return kinetic / 2 + 9.81 * heights


def test_the_drive_supplies_the_power_of_the_rigid_linkage(four_bar, curve):
    assert curve.locked == tuple(MODES)
    found = inverse_dynamics(four_bar, curve, speed=SPEED)
    power = SPEED * CubicSpline(curve.u, energy(curve.u, curve.q))(curve.u, 1)
    inside = slice(8, -8)  # splines are of lower order at the ends
    np.testing.assert_allclose(SPEED * found.efforts[inside, 0], power[inside], atol=1e-4 * np.abs(power).max())


def test_a_table_of_the_drive_is_enough(four_bar, curve):
    expected = inverse_dynamics(four_bar, curve, speed=SPEED)
    t = (curve.u - curve.u[0]) / SPEED
    found = inverse_dynamics(four_bar, {"t": t, "crank": curve.u}, "crank")
    np.testing.assert_allclose(found.efforts, expected.efforts, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.lam[:, :2], expected.lam[:, :2], rtol=1e-5, atol=1e-5)


def test_modes_that_are_named_are_not_added(four_bar):
    """One mode of four held: the others deform, and one degree of freedom is not left."""
    with pytest.raises(InputError, match="4 degrees of freedom are left"):
        kinematics(four_bar, "crank", hold=MODES[:1])
    assert kinematics(four_bar, "crank", hold=MODES, span=(1.0, 1.2), points=5).locked == tuple(MODES)


def test_equilibria_name_the_modes(four_bar):
    with pytest.raises(InputError, match=r"hold coupler.mode 1.*mbdae.equilibrium"):
        mbdae.equilibria(four_bar, "crank")
