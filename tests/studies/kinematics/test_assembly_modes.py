"""Assembly modes against brute force: circles of links crossed on grids."""

import numpy as np
import pytest
from linkages import LINK, PIVOT, TIP, stephenson
from scipy.optimize import brentq

import mbdae
from mbdae import assembly_modes
from mbdae.errors import InputError


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def roots(f, n=4000):
    """Zeros of a function of an angle, found from a grid."""
    grid = np.linspace(-np.pi, np.pi, n)
    values = [f(x) for x in grid]
    found = [brentq(f, a, b) for a, b, x, y in zip(grid, grid[1:], values, values[1:], strict=False) if x * y < 0]
    return [x for x in found if abs(f(x)) < 1e-6]


def by_coupler(theta):
    """Coupler angles that close the four-bar."""
    pivot = np.array([LINK["ground"], 0.0])
    tip = LINK["crank"] * unit(theta)
    return roots(lambda x: np.linalg.norm(tip + LINK["coupler"] * unit(x) - pivot) - LINK["rocker"])


def third(theta, phi):
    return LINK["crank"] * unit(theta) + TIP[0] * unit(phi) + TIP[1] * unit(phi + np.pi / 2)


def test_four_bar_has_two():
    found = assembly_modes(mbdae.load("four_bar"), "crank")
    assert [m.label for m in found.modes] == ["1a", "2a"]  # a Grashof linkage: two circuits
    expected = np.sort([x - 1.2 for x in by_coupler(1.2)])
    np.testing.assert_allclose(np.sort([m.q[1] for m in found.modes]), expected, atol=1e-9)
    np.testing.assert_allclose(found.modes[0].q, mbdae.load("four_bar").start[0], atol=1e-9)
    assert "2 assembly modes" in str(found)


def test_four_bar_by_its_rocker_has_two_on_one_circuit():
    found = assembly_modes(mbdae.load("four_bar"), "rocker")
    assert [(m.label, m.rising) for m in found.modes] == [("1a", True), ("1b", False)]


def test_stephenson_by_its_crank_has_four():
    found = assembly_modes(stephenson(), "crank")
    expected = []
    for phi in by_coupler(1.2):
        span = np.array(PIVOT) - third(1.2, phi)
        levers = roots(lambda x, d=span: np.linalg.norm(d + LINK["lever"] * unit(x)) - LINK["arm"])
        expected += [(phi - 1.2, lever) for lever in levers]
    assert len(found.modes) == len(expected) == 4
    wrapped = [((m.q[1] + np.pi) % (2 * np.pi) - np.pi, (m.q[4] + np.pi) % (2 * np.pi) - np.pi) for m in found.modes]
    expected = [((a + np.pi) % (2 * np.pi) - np.pi, b) for a, b in expected]
    np.testing.assert_allclose(sorted(wrapped), sorted(expected), atol=1e-8)


@pytest.mark.parametrize("lever", [2.4, -2.7, 3.0])
def test_stephenson_by_its_lever_has_as_many_as_the_coupler_curve_crosses_a_circle(lever):
    found = assembly_modes(stephenson(), "lever", lever)
    centre, count = np.array(PIVOT) + LINK["lever"] * unit(lever), 0
    grid = np.linspace(-np.pi, np.pi, 1500)
    for side in (0, 1):
        values = []
        for theta in grid:
            tip, pivot = LINK["crank"] * unit(theta), np.array([LINK["ground"], 0.0])
            span = pivot - tip
            d = np.linalg.norm(span)
            bend = np.arccos((LINK["coupler"] ** 2 + d**2 - LINK["rocker"] ** 2) / (2 * LINK["coupler"] * d))
            phi = np.arctan2(span[1], span[0]) + (1, -1)[side] * bend
            values.append(np.linalg.norm(third(theta, phi) - centre) - LINK["arm"])
        count += int((np.diff(np.sign(values)) != 0).sum())
    assert len(found.modes) == count
    assert count >= 2


def test_modes_are_told_apart_by_named_joints():
    mech = mbdae.load("stewart_platform")
    legs = [f"piston_{i}" for i in range(2, 7)]
    found = assembly_modes(mech, "piston_1", hold=legs, apart="platform", most=150)
    places = np.array([m.q[:3] for m in found.modes])
    assert 2 <= len(places) <= 40  # at most forty solutions: Dietmaier (1998)
    near = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert near.min() > 1e-6


def test_where_it_does_not_reach_there_is_none():
    with pytest.raises(InputError, match="no pose was found at 'rocker' = 3"):
        assembly_modes(mbdae.load("four_bar"), "rocker", 3.0, most=100)
