"""Passive walkers: published gaits, and gaits from an independent program (DOP853 at 3e-14, variational equations)."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli

FOOT_CONTACT = "heel strike"
LONG = {  # incline: angle and rate after the strike, period, multiplier
    0.004: (0.153389564876, -0.156080146676, 3.852613461751, 0.22888996 + 0.59115519j),
    0.009: (0.200310900544, -0.199832473005, 3.882463752851, -0.19009984 + 0.55759878j),
    1e-6: (0.009709374687, -0.010147203353, 3.812249720362, 0.99327509),
}
COMMANDS = ("periodic compass_gait --rtol 1e-8", "periodic-branch simplest_walker incline=0.009:0.0091 --rtol 1e-6")


@pytest.mark.parametrize("incline", LONG)
def test_long_gaits_of_the_simplest_walker(incline):
    """Garcia, Chatterjee, Ruina, Coleman, J. Biomech. Eng. 120 (1998): T -> 3.812, angle/incline^(1/3) -> 0.970956."""
    found = mbdae.periodic(f"simplest_walker?incline={incline}")
    angle, rate, T, multiplier = LONG[incline]
    after = found.after[FOOT_CONTACT]
    assert pytest.approx(T, abs=1e-10) == found.T
    assert after["q.stance"] == pytest.approx(angle, abs=1e-10)
    assert after["v.stance"] == pytest.approx(rate, abs=1e-10)
    assert after["q.swing"] == pytest.approx(2 * angle, abs=1e-10)
    assert np.abs(found.multipliers - multiplier).min() < 2e-8
    assert np.abs(found.multipliers).min() < 1e-9  # two rates are functions of one angle after the strike
    assert found.stability == "stable"
    assert [x.name for x in found.neutral] == ["time"]
    assert found.neutral[0].error < 1e-8
    if incline == 1e-6:
        assert after["q.stance"] / incline ** (1 / 3) == pytest.approx(0.970956, abs=5e-5)
        assert np.abs(found.multipliers - 0.48919606).min() < 2e-8


def test_the_short_gait_is_unstable():
    found = mbdae.periodic(
        "simplest_walker", q={"stance": 0.19394, "swing": 0.38788}, v={"stance": -0.20387, "swing": -0.01513}
    )
    assert pytest.approx(3.096105868078, abs=1e-10) == found.T
    assert found.after[FOOT_CONTACT]["q.stance"] == pytest.approx(0.193937369810, abs=1e-10)
    assert found.after[FOOT_CONTACT]["v.stance"] == pytest.approx(-0.203866927442, abs=1e-10)
    np.testing.assert_allclose(found.multipliers[:2], [4.00386436, 0.45958959], atol=2e-8)
    assert found.stability == "unstable"


@pytest.fixture(scope="session")
def compass():
    return mbdae.periodic("compass_gait")


def test_the_compass_gait(compass):
    """Goswami, Thuilot, Espiau (1996): 0.2187, -0.3234, -1.0918, -0.3772 with g = 9.8, angles from the vertical.

    The strike is the impact law on the closure of the new foot; the other program has the angular momentum.
    """
    after, incline = compass.after[FOOT_CONTACT], np.radians(3.0)
    assert pytest.approx(0.734346391159, abs=1e-10) == compass.T
    assert after["q.stance"] - incline == pytest.approx(0.2186688029, abs=1e-10)
    assert after["q.swing"] - incline == pytest.approx(-0.3233885581, abs=1e-10)
    assert after["v.stance"] == pytest.approx(-1.0923835899, abs=1e-10)
    assert after["v.swing"] == pytest.approx(-0.3773739489, abs=1e-10)
    for z in (-0.19972613 + 0.54447606j, 0.13157262):
        assert np.abs(compass.multipliers - z).min() < 2e-8
    for name, published in (("v.stance", -1.0918), ("v.swing", -0.3772)):
        assert after[name] / np.sqrt(9.81) == pytest.approx(published / np.sqrt(9.8), abs=4e-5)


def test_closures_are_no_unknowns(compass):
    """Four coordinates and three rows, of rank 2: two angles and two rates."""
    assert compass.shooting.n == 4
    assert compass.shooting.matrix.shape == (5, 5)  # with the phase and the period


def test_one_period_is_one_run_that_closes(compass, tmp_path):
    run = compass.run
    assert run.t[-1] - run.t[0] == pytest.approx(compass.T, abs=1e-12)
    np.testing.assert_allclose(run.q[-1], run.q[0], atol=1e-10)
    assert [name for _, name in run.resets] == [FOOT_CONTACT]
    compass.animate(tmp_path / "walk.html")
    compass.plot(tmp_path / "walk.png")
    compass.save(tmp_path / "walk.csv")
    assert "stable" in str(compass)
    assert json.loads(json.dumps(compass.to_dict()))["stability"] == "stable"


def test_a_run_to_steady_state_is_a_guess(compass, tmp_path):
    """The command finds the period of a saved run by itself."""
    sol = mbdae.solve("compass_gait", (0, 12.1), rtol=1e-8)
    sol.save(tmp_path / "run.npz")
    result = CliRunner().invoke(cli, ["periodic", str(tmp_path / "run.npz"), "--rtol", "1e-9", "--json"])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert found["T"] == pytest.approx(compass.T, rel=1e-7)
    assert found["after"][FOOT_CONTACT]["q.stance"] == pytest.approx(compass.after[FOOT_CONTACT]["q.stance"], rel=1e-6)
