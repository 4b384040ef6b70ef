"""Toggle positions and the mechanical advantage, against closed forms."""

import numpy as np
from commands import call
from four_bar_angles import COUPLER, CRANK, GROUND, ROCKER, angles, derivatives

import mbdae
from mbdae import kinematics


def limit(length):
    """Angles of the crank and the rocker where crank and coupler are in line, at a distance from crank to rocker."""
    theta = np.arccos((GROUND**2 + length**2 - ROCKER**2) / (2 * GROUND * length))
    top = length * np.exp(1j * theta) - GROUND
    return theta, np.angle(top)


def test_a_rocker_reverses_where_crank_and_coupler_are_in_line():
    found = kinematics("four_bar", "crank").toggles
    assert [t.reversing for t in found] == [("rocker",), ("rocker",)]
    folded, stretched = limit(COUPLER - CRANK), limit(COUPLER + CRANK)
    expected = [(folded[0] + np.pi, folded[1]), (stretched[0] + 2 * np.pi, stretched[1])]
    np.testing.assert_allclose([(t.u, t.q[2]) for t in found], expected, rtol=0, atol=1e-9)
    same = kinematics("four_bar", "rocker").toggles
    assert [t.reversing for t in same] == [("rocker",), ("rocker",)]
    np.testing.assert_allclose(sorted(t.u for t in same), sorted(x[1] for x in (folded, stretched)), atol=1e-9)


def test_a_slider_reverses_with_its_pose():
    found = kinematics("slider_crank", "crank", span=(-1.0, 4.0))
    np.testing.assert_allclose([t.u for t in found.toggles], [0, np.pi], rtol=0, atol=1e-9)
    np.testing.assert_allclose([t.q[2] for t in found.toggles], [0.45, 0.25], rtol=0, atol=1e-12)
    rows = found.toggle_table()
    assert rows[0] == ["reverses", "crank (rad)", "crank_pin (rad)", "slider (m)"]
    assert rows[1] == ["slider", "0", "0", "0.45"]
    assert kinematics("slider_crank", "crank", span=(0.5, 1.0)).toggle_table() == [rows[0][:2]]


def test_the_mechanical_advantage_is_the_inverse_ratio():
    found = kinematics("four_bar", "crank", points=19)
    rates = np.array([derivatives(u, *angles(u))[1] for u in found.u])
    np.testing.assert_allclose(found.advantage, 1 / rates, rtol=1e-10)
    assert found.to_columns().units["advantage"] == "1"
    np.testing.assert_array_equal(found.signals()["advantage"], found.advantage)
    slider = kinematics("slider_crank", "slider")
    assert slider.to_columns().units["advantage"] == "m/rad"
    np.testing.assert_array_equal(slider.advantage[~slider.moving], 0.0)
    at_limit = kinematics("slider_crank", "crank", span=(0.0, 1.0), points=3)
    assert at_limit.advantage[0] == np.inf
    assert np.isnan(kinematics(mbdae.load("n_four_bar?N=3"), "crank_0", span=(-0.5, -0.2), points=3).advantage).all()


def test_the_command_lists_toggles():
    words = ("kinematics", "slider_crank", "--drive", "crank", "--from", "-1", "--to", "4", "--points", "9")
    code, out, _ = call(*words, "--toggles")
    assert code == 0
    assert out.splitlines()[-2:][0].split() == ["slider", "0", "0", "0.45"]
    assert out.startswith(call(*words)[1].rstrip("\n"))
