"""A four-bar built by hand against an equation of motion in one coordinate, derived and solved without mbdae."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from chains import rod
from four_bar_angles import COUPLER, CRANK, GROUND, ROCKER, angles, derivatives, normal, unit
from scipy.integrate import solve_ivp

import mbdae
from mbdae import Closure, Mechanism

GRAVITY, START, END = 9.81, 1.2, 2.0  # uniform thin rods of 1 kg/m


def motion(t, y):
    """J theta'' + J_theta theta'^2 / 2 + V_theta = 0, with J and V of three rods as functions of the crank angle."""
    theta, rate = y
    phi, psi = angles(theta)
    p, s, dp, ds = derivatives(theta, phi, psi)
    masses = CRANK, COUPLER, ROCKER
    centre = CRANK * normal(theta) + COUPLER / 2 * p * normal(phi)  # of the coupler, per theta'
    dcentre = -CRANK * unit(theta) + COUPLER / 2 * (dp * normal(phi) - p**2 * unit(phi))
    spin = masses[1] * COUPLER**2 / 12
    about_pivot = masses[0] * CRANK**2 / 3, masses[2] * ROCKER**2 / 3
    J = about_pivot[0] + masses[1] * centre @ centre + spin * p**2 + about_pivot[1] * s**2
    dJ = 2 * (masses[1] * centre @ dcentre + spin * p * dp + about_pivot[1] * s * ds)
    lever = masses[0] * CRANK / 2 * np.cos(theta) + masses[1] * centre[1] + masses[2] * ROCKER / 2 * s * np.cos(psi)
    return [rate, -(dJ / 2 * rate**2 + GRAVITY * lever) / J]


@cache
def one_coordinate():
    times = np.linspace(0, END, 41)
    sol = solve_ivp(motion, (0, END), [START, 0.0], method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times)
    theta, rate = sol.y
    relative = np.array([angles(x) for x in theta]).T
    return times, theta, rate, np.unwrap(relative)


def by_hand():
    """Three hinged bars in the x-z plane, positive angles from x to z; the coupler's tip is pinned to the rocker's."""
    model = pin.Model()
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    crank, tip = rod(model, 0, pin.SE3.Identity(), CRANK, "crank", mass=CRANK)
    rod(model, crank, tip, COUPLER, "coupler", mass=COUPLER)
    rod(model, 0, pin.SE3(np.eye(3), np.array([GROUND, 0, 0])), ROCKER, "rocker", mass=ROCKER)
    return Mechanism(model, [Closure.point("coupler_tip", "rocker_tip")])


def start():
    phi, psi = angles(START)
    return np.array([START, phi - START, psi]), np.zeros(3)


def test_the_one_coordinate_equation_keeps_its_energy():
    # guards the reference itself: J and V written a second time, from positions by finite differences
    def heights(theta):
        phi, psi = angles(theta)
        centres = CRANK / 2 * unit(theta), CRANK * unit(theta) + COUPLER / 2 * unit(phi), ROCKER / 2 * unit(psi)
        return np.array(centres), np.array([theta, phi, psi])

    _, theta, rate, _ = one_coordinate()
    masses, lengths = np.array([CRANK, COUPLER, ROCKER]), np.array([CRANK, COUPLER, ROCKER])
    energies = []
    for x, w in zip(theta, rate, strict=True):
        (c1, a1), (c0, a0), (c, _) = heights(x + 1e-5), heights(x - 1e-5), heights(x)
        speed, spin = (c1 - c0) / 2e-5 * w, np.unwrap(np.column_stack([a0, a1]))
        spin = (spin[:, 1] - spin[:, 0]) / 2e-5 * w
        kinetic = 0.5 * masses @ ((speed**2).sum(axis=1) + lengths**2 / 12 * spin**2)
        energies.append(kinetic + GRAVITY * masses @ c[:, 1])
    np.testing.assert_allclose(energies, energies[0], atol=1e-7)
    assert np.ptp(theta) > 1


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("method", "rtol"), [("pherk5", 1e-11), ("pherk6", 1e-10), ("herk5", 1e-9)])
def test_agrees_with_the_one_coordinate_equation(method, rtol):
    times, theta, rate, (phi, psi) = one_coordinate()
    sol = mbdae.solve(by_hand(), (0, END), *start(), method=method, rtol=rtol, t_eval=times)
    assert sol.success
    expected = np.array([theta, phi - theta, psi]).T
    np.testing.assert_allclose(sol.q[-1], expected[-1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.q, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(sol.v[:, 0], rate, rtol=0, atol=1e-7)


@pytest.mark.usefixtures("back_end")
def test_the_model_file_is_the_same_linkage():
    times, theta, _, (phi, psi) = one_coordinate()
    mech = mbdae.load("four_bar")
    np.testing.assert_allclose(mech.start[0], start()[0], atol=1e-10)
    sol = mbdae.solve(mech, (0, END), rtol=1e-11, t_eval=times)
    np.testing.assert_allclose(sol.q, np.array([theta, phi - theta, psi]).T, rtol=0, atol=1e-8)
