"""Newton's law of impact against closed forms, against enumeration, and against energy."""

from itertools import combinations

import numpy as np
import pytest

from mbdae.errors import StepError
from mbdae.mechanism.hybrid.impact_law import FrictionRow, solve_impact


def hit(M, rows, v, e, kept=None, b=None, c=None):
    U = np.linalg.cholesky(M).T
    kept, n = np.zeros((0, len(v))) if kept is None else kept, len(rows)
    return solve_impact(U, kept, np.zeros(len(kept)) if b is None else b, rows, np.zeros(n) if c is None else c, e, v)


@pytest.mark.parametrize(("angle", "e"), [(0.3, 0.0), (0.7, 0.5), (1.2, 1.0)])
def test_a_rod_on_one_end(angle, e):
    # m (v' + v) = p, I w' = p l cos a, I = m l^2/3 of half a length l: p = (1 + e) m v/(1 + 3 cos^2 a)
    m, half, v = 1.7, 0.4, 2.0
    M, row = np.diag([m, m * half**2 / 3]), np.array([[1.0, -half * np.cos(angle)]])
    blow = hit(M, row, np.array([-v, 0.0]), np.array([e]))
    np.testing.assert_allclose(blow.p, (1 + e) * m * v / (1 + 3 * np.cos(angle) ** 2), rtol=1e-15)
    assert row @ blow.v == pytest.approx(e * v, abs=4e-15)


def test_a_rod_on_both_ends():
    m, half, v, e = 1.7, 0.4, 2.0, 0.5
    M, rows = np.diag([m, m * half**2 / 3]), np.array([[1.0, -half], [1.0, half]])
    blow = hit(M, rows, np.array([-v, 0.0]), np.full(2, e))
    np.testing.assert_allclose(blow.p, (1 + e) * m * v / 2, rtol=1e-15)
    np.testing.assert_allclose(blow.v, [e * v, 0], atol=1e-15)


def test_touching_balls_take_part_in_one_impact():
    # Newton's law has no sequence of impacts: (-1, 2, 2)/3, and not (0, 0, 1) as of a cradle
    rows = np.array([[-1.0, 1, 0], [0, -1, 1]])
    blow = hit(np.eye(3), rows, np.array([1.0, 0, 0]), np.ones(2))
    np.testing.assert_allclose(blow.v, np.array([-1, 2, 2]) / 3, atol=1e-15)


def enumerated(M, rows, v, e):
    """The v+ of the only set of impulses that satisfies all conditions."""
    W, u = rows @ np.linalg.solve(M, rows.T), rows @ v
    for k in range(len(rows) + 1):
        for on in map(list, combinations(range(len(rows)), k)):
            p = np.zeros(len(rows))
            p[on] = np.linalg.solve(W[np.ix_(on, on)], -(1 + e[on]) * u[on])
            if (p >= -1e-12).all() and (W @ p + (1 + e) * u >= -1e-12).all():
                return v + np.linalg.solve(M, rows.T @ p)
    raise AssertionError("no choice meets the conditions")


@pytest.mark.parametrize("seed", range(40))
def test_it_agrees_with_enumeration(seed):
    rng = np.random.default_rng(seed)
    n = 5
    A, v, e = rng.normal(size=(n, n)), rng.normal(size=n), rng.uniform(size=3)
    M, rows = A @ A.T + np.eye(n), rng.normal(size=(3, n))
    rows *= -np.sign(rows @ v)[:, None]  # all of them approach
    U = np.linalg.cholesky(M).T
    once = solve_impact(U, *nothing(n), rows, np.zeros(3), e, v)
    if (rows @ once.v > -1e-9).all():
        np.testing.assert_allclose(once.v, enumerated(M, rows, v, e), atol=1e-12)


def nothing(n):
    return np.zeros((0, n)), np.zeros(0)


def test_energy_never_grows_and_loops_stay_closed():
    rng = np.random.default_rng(1)
    for _ in range(500):
        n, k, m = int(rng.integers(2, 8)), int(rng.integers(0, 3)), int(rng.integers(1, 6))
        A = rng.normal(size=(n, n))
        M, kept, rows = A @ A.T + 0.1 * np.eye(n), rng.normal(size=(k, n)), rng.normal(size=(m, n))
        if rng.random() < 0.3:
            rows[-1] = rows[0]  # dependent rows
        v = rng.normal(size=n)
        v -= np.linalg.pinv(kept) @ kept @ v if k else 0
        if k == n:
            continue
        blow = hit(M, rows, v, rng.uniform(size=m) * (rng.random() < 0.7), kept)
        before, after = v @ M @ v / 2, blow.v @ M @ blow.v / 2
        assert after <= before * (1 + 1e-12)
        assert after - before == pytest.approx(blow.work, abs=1e-10 * before)
        assert (rows @ blow.v).min() > -1e-9
        assert np.abs(kept @ blow.v).max(initial=0) < 1e-10
        assert (blow.p >= 0).all()
        np.testing.assert_allclose(M @ (blow.v - v), rows.T @ blow.p + kept.T @ blow.P, atol=1e-8)


def test_a_driver_that_pushes_into_a_stop_is_named():
    kept, b, rows = np.array([[1.0, 0]]), np.array([1.0]), np.array([[1.0, 0]])  # v_1 = -1, and v_1 >= 0
    with pytest.raises(StepError, match="closures block the relative velocity of the impact"):
        hit(np.eye(2), rows, np.array([-1.0, 0]), np.zeros(1), kept, b)


def rubbed(seed, e):
    """Two frictional contacts of a random body: M, v, rows, tangents, and the solution."""
    rng = np.random.default_rng(seed)
    A, v = rng.normal(size=(6, 6)), rng.normal(size=6)
    M, rows, tangents = A @ A.T + np.eye(6), rng.normal(size=(2, 6)), rng.normal(size=(2, 6))
    rubs = [FrictionRow(k, tangents[k], 0.0, 0.4) for k in range(2)]
    nothing = np.zeros((0, 6)), np.zeros(0)
    return (
        M,
        v,
        rows,
        tangents,
        solve_impact(np.linalg.cholesky(M).T, *nothing, rows, np.zeros(2), np.full(2, e), v, rubs),
    )


@pytest.mark.parametrize("seed", [*range(30), 379])  # the last one cycles
def test_frictional_contacts_stick_or_slide_against_the_remaining_slip(seed):
    mu, (M, v, rows, tangents, blow) = 0.4, rubbed(seed, 0.0)
    np.testing.assert_allclose(M @ (blow.v - v), rows.T @ blow.p + tangents.T @ blow.friction, atol=1e-11)
    opening, slip = rows @ blow.v, tangents @ blow.v
    assert (blow.p >= 0).all()
    assert (opening > -1e-11).all()
    assert np.abs(blow.p * opening).max() < 1e-11
    assert (np.abs(blow.friction) <= mu * blow.p + 1e-12).all()
    slides = np.abs(slip) > 1e-10
    np.testing.assert_allclose(blow.friction[slides], -mu * blow.p[slides] * np.sign(slip[slides]), atol=1e-11)
    assert blow.work == pytest.approx((blow.v @ M @ blow.v - v @ M @ v) / 2, abs=1e-11)
    assert blow.work < 1e-12


def test_an_energy_gain_by_friction_and_restitution_is_rejected():
    with pytest.raises(StepError, match="Newton's law with friction increases the energy here"):
        rubbed(399, 0.9)
