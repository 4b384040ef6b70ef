"""Starts of flexible bodies: modes that are not named stay at rest where rigid bodies close the loops."""

import numpy as np
import pytest
from flexible_bodies import CANTILEVER, FOUR_BAR

import mbdae

PEG = """[[frame]]
name = "peg"
parent = "world"
xyz = [1.0, 1.0, 0.0]
[[driver]]
frames = ["bar.tip", "peg"]
motion = { kind = "polynomial", coefficients = [0.99, -0.1] }
"""
PULLED = CANTILEVER + PEG


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    """The four-bar whose file names no mode."""
    path = tmp_path_factory.mktemp("four_bar") / "four_bar.toml"
    before, start = FOUR_BAR.read_text().split("[start]")
    lines = ["[start]", "q = { crank = 1.0472 }", "v = { crank = 8.0 }", *start.strip().splitlines()[2:]]
    path.write_text(before + "\n".join(lines))
    return mbdae.load(path)


def rigid_rates(q, speed):
    """Rates of coupler and rocker of the rigid four-bar, from the closed loop of velocities."""
    (crank, coupler), rocker = np.cumsum(q[[0, 1]]), q[-1]
    along = np.array([[-0.9 * np.sin(coupler), 0.7 * np.sin(rocker)], [0.9 * np.cos(coupler), -0.7 * np.cos(rocker)]])
    absolute, rate = np.linalg.solve(along, -0.3 * speed * np.array([-np.sin(crank), np.cos(crank)]))
    return absolute - speed, rate


def test_modes_stay_at_rest(four_bar):
    q, v = four_bar.start
    assert not q[2:6].any()
    assert not v[2:6].any()
    np.testing.assert_allclose((v[1], v[-1]), rigid_rates(q, 8.0), rtol=1e-10)


def test_modes_that_are_named_are_free(four_bar):
    q, v = four_bar.assemble({"crank": 1.0472}, {"crank": 8.0}, guess={"coupler.mode 1": 1e-3, "rocker": 1.6})
    assert q[2] == pytest.approx(1e-3, rel=0.1)
    assert not q[3:6].any()
    q, v = four_bar.assemble({"crank": 1.0472}, {"crank": 8.0, "coupler.mode 2": 0.01})
    assert v[3] == 0.01
    assert not v[[2, 4, 5]].any()
    free = four_bar.assemble(q, np.eye(7)[0])[1]
    assert np.abs(free[2:6]).max() > 0.1  # a full velocity is changed as little as possible


def test_modes_move_where_they_alone_close_the_loop(tmp_path):
    (tmp_path / "cantilever.toml").write_text(PULLED)
    mech = mbdae.load(tmp_path / "cantilever.toml")
    q, v = mech.start
    by_q = mech.model.flexible[0].modal.nodes["tip"].Phi[1]
    assert mech.frame(q, "bar.tip")[0][1] == pytest.approx(0.01, rel=1e-3)
    assert by_q @ v == pytest.approx(0.1, rel=1e-2)


def test_derivatives_of_the_start_hold_modes(four_bar):
    """By the angle of the crank: the rates of the rigid linkage."""
    run = mbdae.solve(four_bar, (0, 1e-3), method="radau5", step=1e-3)
    found = mbdae.sensitivity(run, ["start.q.crank"])
    expected = rigid_rates(four_bar.start[0], 1.0)
    np.testing.assert_allclose(found.q[0, [1, 6], 0], expected, rtol=1e-8)
    assert not found.q[0, 2:6].any()
    assert not found.v[0, 2:6].any()
