"""Eigenvalues of products, against products that are known by construction."""

import numpy as np
import pytest

from mbdae.studies.periodic.shooting.multipliers import on_quotient, periodic_eigenvalues


def orthogonal(rng, n):
    return np.linalg.qr(rng.standard_normal((n, n)))[0]


def hidden_triangular(rng, diagonals):
    """Factors Q_i R_i Q_i-1^T, whose product has the products of the diagonals as eigenvalues."""
    k, n = diagonals.shape
    Q = [orthogonal(rng, n) for _ in range(k)]
    R = [np.diag(d) @ (np.eye(n) + 0.3 * np.triu(rng.standard_normal((n, n)), 1)) for d in diagonals]
    return [Q[(i + 1) % k] @ R[i] @ Q[i].T for i in range(k)]


def test_small_multipliers_beside_large_ones_have_digits():
    """The product has none of those below 1e-16 of the largest one."""
    rng = np.random.default_rng(1)
    diagonals = np.array([40.0, 3.0, 0.5, 0.02]) * rng.uniform(0.8, 1.2, (12, 4))
    factors = hidden_triangular(rng, diagonals)
    expected = np.prod(diagonals, axis=0)
    np.testing.assert_allclose(periodic_eigenvalues(factors), expected, rtol=1e-11)
    product = np.linalg.eigvals(np.linalg.multi_dot(factors[::-1]))
    assert np.abs(product).min() > 1e3 * expected[-1]


@pytest.mark.parametrize("k", [1, 2, 7])
def test_complex_pairs_and_repeated_ones_are_those_of_the_product(k):
    rng = np.random.default_rng(k)
    factors = [0.6 * rng.standard_normal((5, 5)) for _ in range(k)]
    expected = np.linalg.eigvals(np.linalg.multi_dot([*factors[::-1], np.eye(5)]))
    found = periodic_eigenvalues(factors)
    for z in expected:
        assert np.abs(found - z).min() < 1e-12 * np.abs(expected).max()


def test_known_directions_leave_the_other_multipliers():
    """W = the first columns are invariant, E = the last row of each, with E W = 0."""
    rng = np.random.default_rng(3)
    k, n = 3, 6
    blocks = [np.triu(rng.standard_normal((n, n)), 1) + np.diag([1.0, 1.0, 2.0, 0.5, 0.3, 1.0]) for _ in range(k)]
    Q = [orthogonal(rng, n) for _ in range(k)]
    factors = [Q[(i + 1) % k] @ blocks[i] @ Q[i].T for i in range(k)]
    known = [np.column_stack([q[:, :2] @ rng.standard_normal((2, 2)), q[:, -1]]) for q in Q]
    found = periodic_eigenvalues(on_quotient(factors, known))
    np.testing.assert_allclose(found, [8.0, 0.125, 0.027], rtol=1e-12)
