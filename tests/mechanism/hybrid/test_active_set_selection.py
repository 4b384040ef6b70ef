"""Active-set selection: against enumeration of all cases, and against closed forms."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, linprog

from mbdae.errors import StepError
from mbdae.mechanism.hybrid import friction_utilization
from mbdae.mechanism.hybrid.box_lcp import solve_box_lcp
from mbdae.mechanism.hybrid.friction_utilization import least_utilization

INF = np.inf


def enumerate_cases(W, a, lower, upper):
    """Accelerations such that each row is active within its limits, or at one and accelerates away: try all cases."""
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
def test_the_active_set_agrees_with_enumeration(seed):
    rng = np.random.default_rng(seed)
    m = rng.integers(1, 5)
    B = rng.normal(size=(m + 2, m)) * 10.0 ** rng.uniform(-3, 3, m)
    a = rng.normal(size=m) * np.linalg.norm(B, axis=0)
    size = 1 / np.linalg.norm(B, axis=0)
    limit = rng.uniform(0.1, 1.5, m) * size
    presses = rng.random(m) < 0.4
    lower, upper = np.where(presses, 0.0, -limit), np.where(presses, INF, limit)
    acc = a + B.T @ B @ solve_box_lcp(B, a, lower, upper)
    scaled = enumerate_cases(B.T @ B * np.outer(size, size), a * size, lower / size, upper / size)
    np.testing.assert_allclose(acc * size, scaled, atol=1e-8)


def test_dependent_rows_that_contradict_each_other_agree_with_enumeration():
    """Rows of a driven body cannot all be active; accelerations are unique where there are multipliers."""
    rng, solved = np.random.default_rng(0), 0
    for _ in range(60):
        m = rng.integers(2, 5)
        B = np.outer(rng.normal(size=2), rng.choice([-2.0, -1.0, 1.0, 2.0], m))  # of rank one
        presses, a = rng.random(m) < 0.6, rng.normal(size=m)
        lower, upper = np.where(presses, 0.0, -1.0), np.where(presses, INF, 1.0)
        expected = enumerate_cases(B.T @ B, a, lower, upper)
        if expected is not None:
            solved += 1
            np.testing.assert_allclose(a + B.T @ B @ solve_box_lcp(B, a, lower, upper), expected, atol=1e-8)
    assert solved > 20


def test_a_block_on_an_incline_slides_against_friction():
    B, weight = np.array([[0.5**0.5]]), 7.0  # 2 kg
    (lam,) = solve_box_lcp(B, np.array([weight / 2]), np.array([-5.0]), np.array([5.0]))
    assert lam == -5.0
    (lam,) = solve_box_lcp(B, np.array([weight / 2]), np.array([-7.5]), np.array([7.5]))
    assert lam == pytest.approx(-7.0, abs=1e-14)


@pytest.mark.parametrize(("gear", "together"), [(1.0, 4.0), (2.0, 5.0)])
@pytest.mark.parametrize("part", [0.5, 0.999999, 1.5])
def test_dependent_rows_have_least_norm(gear, together, part):
    """Two brakes, 3 and 1 N, of one block; the second one turns as fast, or twice as fast: they hold 4 N, or 5 N."""
    B, a, limit = np.array([[1.0, gear]]), np.array([1.0, gear]), np.array([3.0, 1.0])
    lam = -part * together * np.linalg.pinv(B)[:, 0]  # of least norm
    null = np.array([[gear], [-1.0]])
    assert least_utilization(lam / limit, null / limit[:, None]) == pytest.approx(part, rel=1e-13)
    acc = part * together + (B @ solve_box_lcp(B, part * together * a, -limit, limit))[0]
    assert acc == pytest.approx(max(0.0, part - 1) * together, abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_the_least_utilization_minimizes_the_maximum(seed):
    """Against a fine search over the single free multiplier."""
    rng = np.random.default_rng(seed)
    ratios, null = rng.normal(size=5), rng.normal(size=(5, 1))
    z = np.linspace(-20, 20, 400001)
    searched = np.abs(ratios[:, None] + null * z).max(axis=0).min()
    assert least_utilization(ratios, null) == pytest.approx(searched, abs=3e-4)
    assert least_utilization(ratios, null) <= searched


@pytest.mark.parametrize("seed", range(10))
def test_where_one_motion_is_left_the_share_is_that_of_the_works(seed, monkeypatch):
    """Against the linear programme, which is not solved where joints of one degree of freedom stick."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(2, 6))
    ratios, null = rng.normal(size=m), rng.normal(size=(m, m - 1))
    ones = np.ones((m, 1))
    A, b = np.block([[null, -ones], [-null, -ones]]), np.concatenate([-ratios, ratios])
    least = linprog(np.append(np.zeros(m - 1), 1.0), A, b, bounds=(None, None), method="highs").fun
    monkeypatch.setattr(friction_utilization, "linprog", None)
    assert least_utilization(ratios, null) == pytest.approx(least, rel=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 1.0, 1e20, np.inf])
def test_the_utilization_is_that_of_multipliers_of_any_size(size):
    """|1 + z|, |2 z - 2| and |3 - z| <= 2 with z = 1 alone, which the first and the last row determine."""
    ratios, null = np.array([1.0, -2.0, 3.0]) * size, np.array([[1.0], [2.0], [-1.0]])
    assert least_utilization(ratios, null) == pytest.approx(2 * size, rel=1e-13)


def test_a_linear_programme_that_fails_is_an_error(monkeypatch):
    failed = OptimizeResult(success=False, status=4, message="numerical difficulties", x=None)
    monkeypatch.setattr(friction_utilization, "linprog", lambda *a, **k: failed)
    with pytest.raises(StepError, match="utilization of redundant stiction limits is unknown: numerical diff") as e:
        least_utilization(np.array([1.0, -2.0, 3.0]), np.array([[1.0], [2.0], [-1.0]]))
    assert e.value.status == "friction"
