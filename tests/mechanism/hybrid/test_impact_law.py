"""Newton's law of impact against closed forms, against enumeration, and against energy."""

from itertools import combinations

import numpy as np
import pytest

from mbdae.errors import StepError
from mbdae.mechanism.hybrid.impact_law import FrictionRow, solve_impact

MU = 0.4


def impact(M, rows, v, e, bilateral=None, b=None):
    """Solve for bilateral rows with velocities -b, and contacts that approach with v."""
    n = len(v)
    bilateral = np.zeros((0, n)) if bilateral is None else bilateral
    b = np.zeros(len(bilateral)) if b is None else b
    return solve_impact(np.linalg.cholesky(M).T, bilateral, b, rows, np.zeros(len(rows)), e, v)


@pytest.mark.parametrize(("angle", "e"), [(0.3, 0.0), (0.7, 0.5), (1.2, 1.0)])
def test_a_rod_on_one_end(angle, e):
    # it falls with v, l is half its length: m (v+ + v) = p, I w+ = -p l cos a, p = (1 + e) m v/(1 + 3 cos^2 a)
    m, half_length, v = 1.7, 0.4, 2.0
    M, row = np.diag([m, m * half_length**2 / 3]), np.array([[1.0, -half_length * np.cos(angle)]])
    solution = impact(M, row, np.array([-v, 0.0]), np.array([e]))
    np.testing.assert_allclose(solution.p, (1 + e) * m * v / (1 + 3 * np.cos(angle) ** 2), rtol=1e-15)
    assert row @ solution.v == pytest.approx(e * v, abs=4e-15)


def test_a_rod_on_both_ends():
    m, half_length, v, e = 1.7, 0.4, 2.0, 0.5
    M, rows = np.diag([m, m * half_length**2 / 3]), np.array([[1.0, -half_length], [1.0, half_length]])
    solution = impact(M, rows, np.array([-v, 0.0]), np.full(2, e))
    np.testing.assert_allclose(solution.p, (1 + e) * m * v / 2, rtol=1e-15)
    np.testing.assert_allclose(solution.v, [e * v, 0], atol=1e-15)


def test_touching_balls_take_part_in_one_impact():
    # Newton's law has no sequence of impacts: (-1, 2, 2)/3, not (0, 0, 1) as in Newton's cradle
    rows = np.array([[-1.0, 1, 0], [0, -1, 1]])
    solution = impact(np.eye(3), rows, np.array([1.0, 0, 0]), np.ones(2))
    np.testing.assert_allclose(solution.v, np.array([-1, 2, 2]) / 3, atol=1e-15)


def solve_by_enumeration(M, rows, v, e):
    """The v+ of an active set whose impulses satisfy all conditions; v+ is the same for all such sets."""
    W, u = rows @ np.linalg.solve(M, rows.T), rows @ v
    for k in range(len(rows) + 1):
        for active in map(list, combinations(range(len(rows)), k)):
            p = np.zeros(len(rows))
            p[active] = np.linalg.solve(W[np.ix_(active, active)], -(1 + e[active]) * u[active])
            if (p >= -1e-12).all() and (W @ p + (1 + e) * u >= -1e-12).all():
                return v + np.linalg.solve(M, rows.T @ p)
    raise AssertionError("no active set satisfies the conditions")


@pytest.mark.parametrize("seed", range(40))
def test_it_agrees_with_enumeration(seed):
    rng = np.random.default_rng(seed)
    n = 5
    A, v, e = rng.normal(size=(n, n)), rng.normal(size=n), rng.uniform(size=3)
    M, rows = A @ A.T + np.eye(n), rng.normal(size=(3, n))
    rows *= -np.sign(rows @ v)[:, None]  # all contacts approach
    solution = impact(M, rows, v, e)
    assert (rows @ solution.v > -1e-9).all()
    np.testing.assert_allclose(solution.v, solve_by_enumeration(M, rows, v, e), atol=1e-12)


@pytest.mark.slow
def test_energy_never_grows_and_loops_stay_closed():
    rng = np.random.default_rng(1)
    for _ in range(500):
        n, m = int(rng.integers(2, 8)), int(rng.integers(1, 6))
        k = int(rng.integers(0, min(3, n)))
        A = rng.normal(size=(n, n))
        M, bilateral, rows = A @ A.T + 0.1 * np.eye(n), rng.normal(size=(k, n)), rng.normal(size=(m, n))
        if m > 1 and rng.random() < 0.3:
            rows[-1] = rows[0]  # dependent rows
        v = rng.normal(size=n)
        v -= np.linalg.pinv(bilateral) @ bilateral @ v if k else 0
        solution = impact(M, rows, v, rng.uniform(size=m) * (rng.random() < 0.7), bilateral)
        before, after = v @ M @ v / 2, solution.v @ M @ solution.v / 2
        assert after <= before * (1 + 1e-12)
        assert after - before == pytest.approx(solution.work, abs=1e-10 * before)
        assert (rows @ solution.v).min() > -1e-9
        assert np.abs(bilateral @ solution.v).max(initial=0) < 1e-10
        assert (solution.p >= 0).all()
        impulse = rows.T @ solution.p + bilateral.T @ solution.P
        np.testing.assert_allclose(M @ (solution.v - v), impulse, atol=1e-8)


def test_a_driver_into_a_stop_is_rejected():
    bilateral, b, rows = np.array([[1.0, 0]]), np.array([1.0]), np.array([[1.0, 0]])  # v_1 = -1, and v_1 >= 0
    with pytest.raises(StepError, match="closures block the relative velocity of the impact"):
        impact(np.eye(2), rows, np.array([-1.0, 0]), np.zeros(1), bilateral, b)


def frictional_impact(seed, e):
    """Two frictional contacts of a random body: M, v, rows, tangents, and the solution."""
    rng = np.random.default_rng(seed)
    A, v = rng.normal(size=(6, 6)), rng.normal(size=6)
    M, rows, tangents = A @ A.T + np.eye(6), rng.normal(size=(2, 6)), rng.normal(size=(2, 6))
    friction = [FrictionRow(k, tangents[k], 0.0, MU) for k in range(2)]
    no_rows = np.zeros((0, 6)), np.zeros(0)
    solution = solve_impact(np.linalg.cholesky(M).T, *no_rows, rows, np.zeros(2), np.full(2, e), v, friction)
    return M, v, rows, tangents, solution


@pytest.mark.parametrize("seed", [*range(30), 379])  # 379: the active sets repeat
def test_frictional_contacts_stick_or_slide_against_the_remaining_slip(seed):
    M, v, rows, tangents, solution = frictional_impact(seed, 0.0)
    impulse = rows.T @ solution.p + tangents.T @ solution.friction
    np.testing.assert_allclose(M @ (solution.v - v), impulse, atol=1e-11)
    normal, slip = rows @ solution.v, tangents @ solution.v
    assert (solution.p >= 0).all()
    assert (normal > -1e-11).all()
    assert np.abs(solution.p * normal).max() < 1e-11
    assert (np.abs(solution.friction) <= MU * solution.p + 1e-12).all()
    slides = np.abs(slip) > 1e-10
    kinetic = -MU * solution.p[slides] * np.sign(slip[slides])
    np.testing.assert_allclose(solution.friction[slides], kinetic, atol=1e-11)
    assert solution.work == pytest.approx((solution.v @ M @ solution.v - v @ M @ v) / 2, abs=1e-11)
    assert solution.work < 1e-12


def test_an_energy_gain_by_friction_and_restitution_is_rejected():
    with pytest.raises(StepError, match="Newton's law with friction increases the energy"):
        frictional_impact(399, 0.9)
