"""Eigenvalues over a parameter: they are followed, and stability is lost where closed forms say."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError
from mbdae.studies.modes.root_locus import read_range


@pytest.mark.slow
def test_a_top_falls_asleep_above_its_critical_spin(tmp_path):
    found = mbdae.root_locus("sleeping_top", "spin", np.linspace(100, 300, 21))
    I1, I3 = 15.0 + 0.234375, 0.46875
    assert found.changes == pytest.approx([2 * np.sqrt(15 * 9.81 * I1) / I3], rel=1e-8)
    assert found.eigenvalues.shape == (21, 6)
    steps = np.abs(np.diff(found.eigenvalues, axis=0))
    assert steps.max() < 13  # 10 rad/s of spin: no eigenvalue jumps to another branch
    found.plot(tmp_path / "locus.png")
    assert (tmp_path / "locus.png").stat().st_size > 10_000


def test_a_bicycle_is_stable_above_its_weave_speed():
    """Meijaard et al. (2007)."""
    found = mbdae.root_locus("bicycle", "speed", [4.2, 4.4])
    assert found.changes == pytest.approx([4.29238253634111], rel=1e-12)


def test_a_speed_is_a_parameter(tmp_path):
    found = mbdae.root_locus("flyball_governor", "v.shaft", [5.0, 2 * np.pi, 7.0])
    assert np.abs(found.eigenvalues[1].imag - 6.45591416).min() < 1e-8
    found.plot(tmp_path / "campbell.svg")
    assert "root locus of flyball_governor over v.shaft" in str(found)
    loaded = mbdae.root_locus(mbdae.load("flyball_governor"), "v.shaft", [5.0, 2 * np.pi, 7.0])
    np.testing.assert_array_equal(loaded.eigenvalues, found.eigenvalues)
    assert "root locus of Stiff flyball governor over v.shaft" in str(loaded)


def test_values_without_modes_are_reported():
    found = mbdae.root_locus("sleeping_top", "spin", [100.0, 2000.0, 250.0])
    assert np.isnan(found.eigenvalues[1]).all()
    assert "less than or equal to 1000" in found.messages[1]
    assert not np.isnan(found.eigenvalues[[0, 2]]).any()
    with pytest.raises(UnknownNameError, match="spine"):
        mbdae.root_locus("sleeping_top", "spine", [1.0])
    with pytest.raises(InputError, match=r"no value of v\.crank has modes"):
        mbdae.root_locus("four_bar", "v.crank", [1.0])


def test_ranges_are_read():
    name, values = read_range("spin=100:300:5")
    assert (name, values.tolist()) == ("spin", [100, 150, 200, 250, 300])
    with pytest.raises(InputError, match="name=first:last:number"):
        read_range("spin=100")


def test_where_the_model_starts_stays_as_it_is():
    """A link that hangs from a joint that is held, or stands on it: the squares of its eigenvalues have other signs."""
    words = ["root-locus", "double_pendulum", "gravity.2=-9.81:-1:2", "--hold", "joint1", "--json"]
    squares = []
    for angle in ("1.0", "0.0"):
        done = CliRunner().invoke(cli, [*words, "--start", f"q.joint1={angle}", "--start", "q.joint2=0"])
        assert done.exit_code == 0, done.output
        re, im = np.array(json.loads(done.stdout)["eigenvalues"]).T
        squares.append(((re + 1j * im) ** 2).real.T)
    assert (squares[0] < -0.1).all()
    np.testing.assert_allclose(squares[1], -squares[0], rtol=1e-9)
    with pytest.raises(UnknownNameError, match="unknown joint 'joint3'"):
        mbdae.root_locus("double_pendulum", "gravity.2", [-9.81], start={"start.q.joint3": 0.0})
