"""Which rows hold: against enumeration of all cases, and against closed forms."""

from itertools import product

import numpy as np
import pytest
from mbdae.mechanism.formulations.holding import least_constraint, load, refuse_wedged

from mbdae.errors import StepError

INF = np.inf


def enumerate_cases(W, a, lower, upper):
    """Accelerations for which each row is held within its limits, or is at one and accelerates away: try all cases."""
    m = len(a)
    for case in product((0, -1, 1), repeat=m):
        lam = np.array([lower[i] if c < 0 else upper[i] if c > 0 else 0.0 for i, c in enumerate(case)])
        held = [i for i in range(m) if case[i] == 0]
        if not np.isfinite(lam).all():
            continue
        if held:
            lam[held] = np.linalg.lstsq(W[np.ix_(held, held)], -(a + W @ lam)[held], rcond=1e-9)[0]
        acc = a + W @ lam
        fits = [
            abs(acc[i]) < 1e-9 and lower[i] - 1e-9 <= lam[i] <= upper[i] + 1e-9
            if c == 0
            else -c * acc[i] >= -1e-9
            for i, c in enumerate(case)
        ]
        if all(fits):
            return acc
    return None


@pytest.mark.parametrize("seed", range(40))
def test_what_holds_is_what_a_look_at_all_cases_finds(seed):
    rng = np.random.default_rng(seed)
    m = rng.integers(1, 5)
    B = rng.normal(size=(m + 2, m)) * 10.0 ** rng.uniform(-3, 3, m)
    a = rng.normal(size=m) * np.linalg.norm(B, axis=0)
    size = 1 / np.linalg.norm(B, axis=0)
    limit = rng.uniform(0.1, 1.5, m) * size
    presses = rng.random(m) < 0.4
    lower, upper = np.where(presses, 0.0, -limit), np.where(presses, INF, limit)
    acc = a + B.T @ B @ least_constraint(B, a, lower, upper)
    scaled = enumerate_cases(B.T @ B * np.outer(size, size), a * size, lower / size, upper / size)
    np.testing.assert_allclose(acc * size, scaled, atol=1e-8)


def test_a_block_on_a_slope_slides_with_what_friction_leaves():
    B, weight = np.array([[0.5**0.5]]), 7.0  # 2 kg
    (lam,) = least_constraint(B, np.array([weight / 2]), np.array([-5.0]), np.array([5.0]))
    assert lam == -5.0
    (lam,) = least_constraint(B, np.array([weight / 2]), np.array([-7.5]), np.array([7.5]))
    assert lam == pytest.approx(-7.0, abs=1e-14)


def test_rows_that_depend_on_each_other_share_the_load():
    """Two brakes, 3 and 1 N, of one block that moves as one, or twice as fast: they hold 4 N, or 5 N."""
    for gear, together in ((1.0, 4.0), (2.0, 5.0)):
        B, a = np.array([[1.0, gear]]), np.array([1.0, gear])
        limit = np.array([3.0, 1.0])
        for force in (0.5 * together, 0.999999 * together, 1.5 * together):
            kappa, lam = load(B, force * a, -limit, limit)
            assert kappa == pytest.approx(force / together, rel=1e-12)
            assert lam @ B[0] == pytest.approx(-force, rel=1e-12)
            acc = force + (B @ least_constraint(B, force * a, -limit, limit))[0]
            assert acc == pytest.approx(max(0.0, force - together), abs=1e-12)
            assert (np.abs(lam) <= kappa * limit * (1 + 1e-12)).all()


def test_what_only_presses_does_not_pull():
    B, a = np.eye(1), np.array([-9.81])
    assert load(B, a, np.zeros(1), np.full(1, INF))[0] == 0.0
    assert load(B, -a, np.zeros(1), np.full(1, INF))[0] == INF
    two = np.ones((1, 2))  # two feet under one weight
    assert load(two, np.full(2, -9.81), np.zeros(2), np.full(2, INF))[0] == 0.0
    assert load(two, np.full(2, 9.81), np.zeros(2), np.full(2, INF))[0] == INF
    assert load(two, np.zeros(2), np.zeros(2), np.full(2, INF))[0] == 0.0


def test_what_has_no_limit_holds_nothing():
    lam = least_constraint(np.eye(2), np.array([1.0, 2.0]), np.array([0.0, -5.0]), np.array([0.0, 5.0]))
    np.testing.assert_allclose(lam, [0.0, -2.0])
    assert least_constraint(np.zeros((3, 0)), np.zeros(0), np.zeros(0), np.zeros(0)).shape == (0,)


def test_a_rod_that_is_pushed_ahead_wedges():
    """Painleve's rod, uniform, length 2, sliding on one end: 1 + 3 cos a (cos a - mu sin a) vanishes at mu = 4/3."""
    a = np.arctan(2.0)  # where mu is smallest

    def gain(mu):
        return np.array([[1 + 3 * np.cos(a) * (np.cos(a) - mu * np.sin(a))]])

    refuse_wedged(gain(1.333), ["rod"], 0.0)
    with pytest.raises(StepError, match=r"friction wedges 'rod' at t = 2"):
        refuse_wedged(gain(1.334), ["rod"], 2.0)
