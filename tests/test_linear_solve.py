"""Least squares against numpy, which takes longer on small systems."""

import numpy as np
import pytest

from mbdae.linear_solve import least_squares


@pytest.mark.parametrize("shape", [(3, 3), (2, 5), (7, 3), (1, 1), (40, 60), (0, 3), (3, 0)])
def test_solutions_are_those_of_numpy(shape):
    """Of smallest norm, with rows that depend on each other."""
    rng = np.random.default_rng(0)
    A, b = rng.standard_normal(shape), rng.standard_normal(shape[0])
    A[2:3] = A[:1]
    before = A.copy(), b.copy()
    np.testing.assert_allclose(least_squares(A, b, 1e-9), np.linalg.lstsq(A, b, rcond=1e-9)[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(A, before[0])
    np.testing.assert_array_equal(b, before[1])
