"""The four-bar of models/four_bar in closed form, from the intersection of two circles."""

import numpy as np

CRANK, COUPLER, ROCKER, GROUND = 1.0, 2.0, 1.5, 2.0  # m


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def normal(angle):
    return np.array([-np.sin(angle), np.cos(angle)])


def angles(theta):
    """Return absolute angles phi of the coupler and psi of the rocker, the upper intersection."""
    tip, pivot = CRANK * unit(theta), np.array([GROUND, 0.0])
    span = pivot - tip
    length = np.linalg.norm(span)
    bend = np.arccos((COUPLER**2 + length**2 - ROCKER**2) / (2 * COUPLER * length))
    phi = np.arctan2(span[1], span[0]) + bend
    top = tip + COUPLER * unit(phi) - pivot
    return phi, np.arctan2(top[1], top[0])


def derivatives(theta, phi, psi):
    """Return first derivatives p, s of phi and psi with respect to theta, and second ones.

    CRANK e(theta) + COUPLER e(phi) = (GROUND, 0) + ROCKER e(psi), differentiated twice.
    """
    matrix = np.column_stack([COUPLER * normal(phi), -ROCKER * normal(psi)])
    p, s = np.linalg.solve(matrix, -CRANK * normal(theta))
    bend = CRANK * unit(theta) + COUPLER * unit(phi) * p**2 - ROCKER * unit(psi) * s**2
    return p, s, *np.linalg.solve(matrix, bend)
