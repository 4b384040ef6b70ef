"""Central differences of order six compared with known derivatives."""

import numpy as np
import pytest

from mbdae.finite_differences import STENCIL, central_difference, numerical_derivative, numerical_jacobian


def test_polynomials_of_degree_six_are_exact():
    for n in range(1, 7):
        assert numerical_derivative(lambda x, n=n: x**n, 0.5) == pytest.approx(float(n == 1), abs=1e-14)
    assert numerical_derivative(lambda x: x**7, 0.5) == pytest.approx(36 * 0.5**6)  # the first one that is not


def test_the_error_falls_with_the_sixth_power():
    errors = [abs(numerical_derivative(lambda x: np.exp(x), h) - 1.0) for h in (0.4, 0.2)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(6.0, abs=0.05)
    assert errors[1] == pytest.approx(0.2**6 / 140, rel=0.01)


def test_derivatives_of_an_array_by_coordinates():
    A = np.arange(12.0).reshape(2, 2, 3)
    assert numerical_jacobian(lambda x: A @ x, 3, 0.25) == pytest.approx(A, abs=1e-13)


def test_constants_have_zero_derivative():
    assert central_difference(dict.fromkeys(STENCIL, np.array([0.1, 1e9])), 1e-3).tolist() == [0.0, 0.0]
