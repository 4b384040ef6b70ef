"""Eigenvalues of matrices whose entries are known to rounding: exact ones next to 1e7 times larger ones, and chains."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest

from mbdae.mechanism.equilibrium.spectrum import curvature, null_space, spectrum
from mbdae.tolerances import EPS


def vibrating(K):
    """A of y'' = -K y, and the accuracy of its entries."""
    n = len(K)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, np.zeros((n, n))]])
    return A, EPS * np.abs(A)


@pytest.mark.parametrize("fast", [1e3, 1e7])
@pytest.mark.parametrize("slow", [1e-6, 1e-3])
def test_slow_motions_with_fast_and_free_ones(slow, fast):
    """Frequencies of uncoupled masses, 13 decades apart, and two zeros of a free mass."""
    found = spectrum(*vibrating(np.diag([fast**2, 0.0, slow**2])))
    assert np.count_nonzero(found.values == 0) == 2
    frequencies = np.sort(found.values.imag[found.values.imag > 0])
    np.testing.assert_allclose(frequencies, [slow, fast], rtol=1e-15)
    assert not found.growing.any()


@pytest.mark.parametrize("seed", range(5))
def test_chains_of_masses(seed):
    """Springs from 1e-6 to 1e10 between masses: frequencies of the given matrix, in 60 digits."""
    rng = np.random.default_rng(seed)
    k = 10 ** rng.uniform(-6, 10, 4)
    K = np.diag(k)
    for i, j in pairwise(range(4)):
        c = min(k[i], k[j]) * rng.uniform(0.01, 0.1)
        K[[i, j], [j, i]] = -c
    mpmath.mp.dps = 60
    exact = [float(mpmath.sqrt(x)) for x in mpmath.eigsy(mpmath.matrix(K), eigvals_only=True)]
    found = spectrum(*vibrating(K))
    np.testing.assert_allclose(np.sort(found.values.imag[found.values.imag > 0]), sorted(exact), rtol=1e-13)
    assert not found.growing.any()


def test_slow_growth_with_a_fast_motion():
    A = np.zeros((3, 3))
    A[:2, :2], A[2, 2], A[0, 2] = [[0.0, 1.0], [-1e14, 0.0]], 1e-6, 0.3
    found = spectrum(A, EPS * np.abs(A))
    assert found.growing.sum() == 1
    assert found.values[found.growing][0] == pytest.approx(1e-6, rel=1e-9)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("n", [2, 3])
def test_chains_of_equal_values(n, scale, sign):
    """(lambda - sign)^n = 0 with one eigenvector: known to EPS^(1/n), and whether they grow."""
    A = np.diag(np.ones(n - 1), 1)
    A[-1] = -np.poly(np.full(n, sign))[:0:-1]
    d = scale ** np.arange(n)
    A = d[:, None] * A / d
    found = spectrum(A, EPS * np.abs(A))
    np.testing.assert_allclose(found.values.real, sign, rtol=10 * EPS ** (1 / n))
    assert not found.values.imag.any()
    np.testing.assert_array_equal(found.growing, sign > 0)


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_zeros_do_not_depend_on_units(scale):
    """A chain of four zeros, with rounding errors, in coordinates of very different units."""
    A = np.diag([1.0, 1.0, 1.0, 0.0], 1)
    A[4, 4], A[3, 4], A[0, 0] = -1e6, 2.0, 1e-17
    d = scale ** np.arange(5.0)
    found = spectrum(d[:, None] * A / d, EPS * d[:, None] * np.maximum(np.abs(A), 1.0) / d)
    assert np.count_nonzero(found.values == 0) == 4
    assert found.values[4] == pytest.approx(-1e6)


def test_eigenvectors_come_back_from_the_quotient():
    rng = np.random.default_rng(1)
    T = rng.standard_normal((6, 6))
    A = T @ np.diag([0.0, 0.0, -1.0, 2.0, 3.0, -4.0]) @ np.linalg.inv(T)
    found = spectrum(A, EPS * np.abs(T) @ np.diag([4.0] * 6) @ np.abs(np.linalg.inv(T)))
    np.testing.assert_allclose(np.sort(found.values.real), [-4, -1, 0, 0, 2, 3], atol=1e-12)
    np.testing.assert_allclose(A @ found.vectors, found.vectors * found.values, atol=1e-12)


@pytest.mark.parametrize(("soft", "stiff", "negative", "flat"), [
    (-1e-4, 1e6, 1, 0), (-1e-10, 1.0, 1, 0), (1e-2, 1e12, 0, 0), (0.0, 1e12, 0, 1), (-1e-9, -1e9, 2, 0),
])  # fmt: skip
def test_signs_of_soft_springs_among_stiff_ones(soft, stiff, negative, flat):
    H = np.array([[stiff, 0.0], [0.0, soft]])
    e = EPS * np.maximum(np.abs(H), np.diag([0.0, 1e-10]))
    found = curvature(H, e)
    assert (found.negative, found.flat) == (negative, flat)


def test_null_vectors():
    A = np.array([[1.0, 2.0, 3.0], [1e9, 2e9, 3e9], [0.0, 1e-6, 1e-6]])
    null = null_space(A, EPS * np.abs(A))
    assert null.vectors.shape == (3, 1)
    np.testing.assert_allclose(null.vectors[:, 0] / null.vectors[2, 0], [-1.0, -1.0, 1.0], atol=1e-12)
