"""Branches of periodic motions: period doublings, folds, the doubled branch."""

import numpy as np
import pytest
from test_bouncing_ball import OMEGA, E, G, T, ball_on_table, multipliers, start

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.studies.periodic.branch_path import BranchPath


@pytest.fixture(scope="session")
def gaits():
    return mbdae.periodic_branch("simplest_walker", "incline", 0.015, 0.0152, rtol=1e-10)


@pytest.mark.slow
def test_the_walker_doubles_its_period(gaits):
    """At 0.0150884379411 (independent program; 0.0151 in the paper of Garcia et al.), the angle is 0.23716586 there."""
    (at,) = gaits.bifurcations
    assert at.kind == "doubling"
    assert at.value == pytest.approx(0.0150884379411, abs=2e-12)
    assert at.motion.after["heel strike"]["q.stance"] == pytest.approx(0.23716586, abs=1e-8)
    assert np.abs(at.motion.multipliers + 1).min() < 1e-8
    assert gaits.values[[0, -1]] == pytest.approx([0.015, 0.0152], abs=1e-12)
    assert "period doubling" in str(gaits)


@pytest.mark.slow
def test_the_doubled_branch_is_stable_and_limps(gaits, tmp_path):
    """With mu = -1 - s (p - p*) before, its multiplier is 1 - 4 s (p - p*) (normal form of the flip)."""
    (at,) = gaits.bifurcations
    doubled = gaits.doubled(at)
    second = doubled.points[1]
    beyond, found = second.value - at.value, second.motion
    assert beyond > 0
    assert pytest.approx(2 * at.motion.T, rel=1e-2) == found.T
    steps = [x["q.stance"] for x in found.after.values()]
    assert len(steps) == 2
    assert abs(steps[0] - steps[1]) > 1e-3
    assert found.stability == "stable"
    derivative = np.polyfit(gaits.values, gaits.multipliers[:, 0].real, 2) @ [2 * at.value, 1, 0]
    assert 1 - found.multipliers[0].real == pytest.approx(-4 * derivative * beyond, rel=0.02)
    assert doubled.values[-1] == pytest.approx(0.0152, abs=1e-12)
    gaits.plot(tmp_path / "branch.png")
    gaits.save(tmp_path / "branch.csv")
    with pytest.raises(InputError, match="begins at a period doubling"):
        gaits.doubled(at.__class__("fold", at.value, at.motion))


@pytest.mark.slow
def test_a_bouncing_ball_has_a_fold_where_the_table_is_too_slow():
    """Motions of one bounce per period exist for A omega >= u = g T (1 - e)/(2 (1 + e)); at the end mu = 1."""
    least = G * T / 2 * (1 - E) / (1 + E) / OMEGA
    q, v = start(0.0036, -1)
    found = mbdae.periodic_branch(ball_on_table, "amplitude", 0.0036, 0.0005, q=q, v=v, rtol=1e-9, T=T)
    (fold,) = found.bifurcations
    assert fold.kind == "fold"
    assert fold.value == pytest.approx(least, rel=1e-9)
    assert np.abs(fold.motion.multipliers - 1).min() < 1e-3  # a square root
    assert [found.points[i].motion.stability for i in (0, -1)] == ["unstable", "stable"]
    for point, sign in ((found.points[1], -1), (found.points[-1], 1)):
        np.testing.assert_allclose(
            np.poly(point.motion.multipliers), np.poly(multipliers(point.value, sign)), rtol=1e-7
        )


@pytest.mark.slow
def test_a_range_in_single_precision_does_not_round_the_branch():
    q, v = start(0.0036, -1)
    first, last = np.float32(0.0036), np.float32(0.00361)
    runs = [
        mbdae.periodic_branch(ball_on_table, "amplitude", *ends, q=q, v=v, rtol=1e-9, T=T).values
        for ends in ((first, last), (float(first), float(last)))
    ]
    np.testing.assert_array_equal(*runs)


def test_wrong_input_is_one_line():
    with pytest.raises(InputError, match="two different numbers"):
        mbdae.periodic_branch("simplest_walker", "incline", 0.01, 0.01)
    with pytest.raises(UnknownNameError, match="slop"):
        mbdae.periodic_branch("simplest_walker", "slop", 0.01, 0.02)


def test_the_end_of_a_range_is_located_across_a_corner():
    class Corner(BranchPath):
        def __init__(self):
            """Of a branch whose tangent turns too much for a step."""

        def step(self, start, h):
            return None

        def point_on_plane(self, start, h):
            return start + h

    assert Corner().locate_zero(0.0, 1.0, lambda x: x - 0.3) == pytest.approx((0.3, 0.3), abs=1e-9)
