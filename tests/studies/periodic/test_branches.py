"""Branches of periodic motions: period doublings, folds, the doubled branch."""

import numpy as np
import pytest
from test_bouncing_ball import OMEGA, E, G, ball_on_table, multipliers

import mbdae
from mbdae.errors import InputError, UnknownNameError


@pytest.fixture(scope="session")
def gaits():
    return mbdae.periodic_branch("simplest_walker", "slope", 0.0148, 0.0153, rtol=1e-11)


def test_the_walker_doubles_its_period(gaits):
    """At 0.0150884379411 (independent program; 0.0151 in the paper of Garcia et al.), the angle is 0.23716586 there."""
    (at,) = gaits.bifurcations
    assert at.kind == "doubling"
    assert at.value == pytest.approx(0.0150884379411, abs=2e-12)
    assert at.motion.after["heel strike"]["q.stance"] == pytest.approx(0.23716586, abs=1e-8)
    assert np.abs(at.motion.multipliers + 1).min() < 1e-8
    assert gaits.values[[0, -1]] == pytest.approx([0.0148, 0.0153], abs=1e-12)
    assert "period doubling" in str(gaits)


def test_the_doubled_branch_is_stable_and_limps(gaits, tmp_path):
    (at,) = gaits.bifurcations
    doubled = gaits.doubled(at)
    last = doubled.points[1].motion
    assert pytest.approx(2 * at.motion.T, rel=1e-2) == last.T
    steps = [x["q.stance"] for x in last.after.values()]
    assert len(steps) == 2
    assert abs(steps[0] - steps[1]) > 1e-3
    assert doubled.points[1].value > at.value
    assert last.stability == "stable"
    gaits.plot(tmp_path / "branch.png")
    gaits.save(tmp_path / "branch.csv")
    with pytest.raises(InputError, match="begins at a period doubling"):
        gaits.doubled(at.__class__("fold", at.value, at.motion))


def test_a_bouncing_ball_has_a_fold_where_the_table_is_too_slow():
    """Motions of one bounce per period exist for A omega >= u = g T (1 - e)/(2 (1 + e)); at the end mu = 1."""
    T = 2 * np.pi / OMEGA
    least = G * T / 2 * (1 - E) / (1 + E) / OMEGA
    ball = ball_on_table(0.004, -1)
    found = mbdae.periodic_branch(
        lambda A: ball_on_table(A, -1)[0], "A", 0.004, 0.003, q=ball[1], v=ball[2], rtol=1e-10, T=T
    )
    fold = next(b for b in found.bifurcations if b.kind == "fold")
    assert fold.value == pytest.approx(least, rel=1e-9)
    assert np.abs(fold.motion.multipliers - 1).min() < 1e-3  # a square root
    middle = found.points[3]
    np.testing.assert_allclose(
        np.sort(middle.motion.multipliers.real), np.sort(multipliers(middle.value, -1).real), rtol=1e-7
    )


def test_wrong_input_is_one_line():
    with pytest.raises(InputError, match="two different numbers"):
        mbdae.periodic_branch("simplest_walker", "slope", 0.01, 0.01)
    with pytest.raises(UnknownNameError, match="slop"):
        mbdae.periodic_branch("simplest_walker", "slop", 0.01, 0.02)
