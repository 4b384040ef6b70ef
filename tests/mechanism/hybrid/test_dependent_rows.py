"""Impacts on rows that depend on bilateral closure rows: they take no impulse, and change nothing."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty

import mbdae
from mbdae import Mechanism, Stop
from mbdae.errors import StepError
from mbdae.mechanism.hybrid.impact_law import solve_impact


def scene(seed, scale):
    """A mass matrix, bilateral rows with given speeds, one that depends on them, and an impacting one."""
    rng = np.random.default_rng(seed)
    n, A = 6, np.random.default_rng(100 + seed).normal(size=(6, 6))
    M, kept, b, weights = A @ A.T + np.eye(n), rng.normal(size=(3, n)), rng.normal(size=3), rng.normal(size=3)
    v = rng.normal(size=n)
    v -= np.linalg.pinv(kept) @ (kept @ v + b)
    row = rng.normal(size=n)
    row = -row * np.sign(row @ v)
    return M, kept, b, scale * weights, row, v


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_row_that_depends_on_kept_ones_changes_nothing(seed, scale):
    """p = (1 + e) |u| / (a W a^T), W = M^-1 - M^-1 G^T (G M^-1 G^T)^-1 G M^-1, of the impacting row alone."""
    M, kept, b, weights, row, v = scene(seed, scale)
    e, inverse = 0.6, np.linalg.inv(M)
    W = inverse - inverse @ kept.T @ np.linalg.solve(kept @ inverse @ kept.T, kept @ inverse)
    p = -(1 + e) * (row @ v) / (row @ W @ row)
    rows, c = np.array([weights @ kept, row, -weights @ kept]), np.array([weights @ b, 0.0, -weights @ b])
    found = solve_impact(np.linalg.cholesky(M).T, kept, b, rows, c, np.array([0.3, e, 0.3]), v)
    np.testing.assert_allclose(found.v, v + W @ row * p, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(found.p, [0.0, p, 0.0], rtol=1e-9)
    np.testing.assert_allclose(M @ (found.v - v), kept.T @ found.P + row * p, rtol=1e-9, atol=1e-9)


def test_bilateral_rows_that_push_into_a_stop_are_rejected():
    M, kept, b, weights, row, v = scene(3, 1.0)
    rows, c = np.array([weights @ kept, row]), np.array([weights @ b - 0.01, 0.0])
    with pytest.raises(StepError, match="closures block the relative velocity of the impact"):
        solve_impact(np.linalg.cholesky(M).T, kept, b, rows, c, np.zeros(2), v)


@pytest.mark.parametrize("seed", range(6))
def test_redundant_bilateral_rows_change_nothing(seed):
    """All rows together transmit the same impulse, with multipliers of least norm."""
    M, kept, b, weights, row, v = scene(seed, 1.0)
    U, rest = np.linalg.cholesky(M).T, (row[None], np.zeros(1), np.array([0.6]), v)
    whole, bs = np.vstack([kept, weights @ kept, kept[0]]), np.append(b, [weights @ b, b[0]])
    one, all_rows = solve_impact(U, kept, b, *rest), solve_impact(U, whole, bs, *rest)
    np.testing.assert_allclose(all_rows.v, one.v, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(all_rows.p, one.p, rtol=1e-10)
    np.testing.assert_allclose(whole.T @ all_rows.P, kept.T @ one.P, rtol=1e-9, atol=1e-9)
    assert np.linalg.norm(all_rows.P) <= np.linalg.norm(one.P) * (1 + 1e-12)


@pytest.mark.parametrize("backend", ["native", "python"])
def test_many_stops_of_which_none_is_active(backend):
    """More rows than are factorized densely, all zero at the start; carts reach their stops at 1 m."""
    model, n = empty(), 17
    for k in range(n):
        add_body(model, 0, pin.JointModelPX(), f"cart_{k}")
    mech = Mechanism(model, stops=[Stop(joint=f"cart_{k}", lower=-1.0, upper=1.0) for k in range(n)])
    sol = mbdae.solve(mech, (0, 1), np.zeros(n), np.arange(n) / 8, backend=backend)
    assert sol.success
    assert sol.q[-1] == pytest.approx(np.minimum(np.arange(n) / 8, 1.0), abs=1e-9)
