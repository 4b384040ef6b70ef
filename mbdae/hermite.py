"""Dense output: Hermite polynomials through both ends of a step, with rates at interior nodes.

A step provides states and their rates of change at both ends. The Hermite interpolant of these data is refined by
collocation: rates at m interior nodes, evaluated on the previous polynomial, define a polynomial of higher degree; each
sweep raises the order by one (Enright, Jackson, Noersett, Thomsen, ACM TOMS 12 (1986), bootstrapping).
"""

from collections.abc import Callable
from functools import cache
from math import factorial, perm

import numpy as np

from .system import Array


def nodes(m: int) -> Array:
    """Return interior nodes in (0, 1), (m,): equidistant; for odd m, the first m of m + 1 equidistant nodes.

    Gauss points are not suitable: together with the data at both ends, an odd number of rates at symmetric nodes, or
    four second derivatives at Gauss points, do not determine a polynomial (Hermite-Birkhoff interpolation).
    """
    return np.arange(1, m + 1) / (m + 1 + m % 2)


def powers(theta: float, degree: int, derivative: int = 0) -> Array:
    """Return the monomials 1, theta, ..., theta^degree, or a derivative of them, (degree + 1,)."""
    factors, exponents = _monomials(degree, derivative)
    return factors * float(theta) ** exponents


@cache
def _monomials(degree: int, derivative: int) -> tuple[Array, Array]:
    """Return factors and exponents of the derivative of 1, theta, ..., theta^degree, (degree + 1,) each."""
    k = np.arange(degree + 1)
    factors = np.array([float(perm(i, derivative)) for i in range(degree + 1)])
    return factors, np.maximum(k - derivative, 0)


@cache
def _inverse(order: int, m: int) -> Array:
    ends = [powers(theta, 2 * order + 1 + m, d) for d in range(order + 1) for theta in (0.0, 1.0)]
    inner = [powers(theta, 2 * order + 1 + m, order) for theta in nodes(m)]
    return np.linalg.inv(np.array(ends + inner))


def fit(ends: list[tuple[Array, Array]], inner: Array) -> Array:
    """Return coefficients (degree + 1, n) of the polynomial in theta with given values and derivatives.

    Args:
        ends: vectors (n,) at theta = 0 and 1, for the derivatives 0, 1, ..., k with respect to theta.
        inner: derivatives of order k at `nodes`, (m, n).
    """
    data = np.array([v for pair in ends for v in pair] + list(inner))
    return _inverse(len(ends) - 1, len(inner)) @ data


def fit_many(ends: list[tuple[Array, Array]], inner: list[Array]) -> Array:
    """Return coefficients (m, degree + 1, n) of m polynomials: like `fit`, with vectors (m, n) in place of (n,)."""
    data = np.array([v for pair in ends for v in pair] + inner)
    return np.einsum("ij,jmn->min", _inverse(len(ends) - 1, len(inner)), data)


def values(c: Array, theta: Array, derivative: int = 0) -> Array:
    """Return values or derivatives (m, n) of m polynomials with coefficients c (m, degree + 1, n) at theta (m,)."""
    out = np.zeros((len(c), c.shape[2]))
    for k in range(c.shape[1] - 1, derivative - 1, -1):
        out = out * theta[:, None] + factorial(k) // factorial(k - derivative) * c[:, k]
    return out


def refine(ends: list[tuple[Array, Array]], rate: Callable[[float, Array], Array], sweeps: int) -> Array:
    """Fit a polynomial to the data at both ends, and raise its order by collocation.

    Args:
        ends: as for `fit`.
        rate: (theta, current coefficients) -> the highest given derivative at theta, (n,).
        sweeps: number of sweeps and of interior nodes; each sweep raises the order by one.
    """
    c = fit(ends, np.empty((0, len(ends[0][0]))))
    for _ in range(sweeps):
        c = fit(ends, np.array([rate(theta, c) for theta in nodes(sweeps)]))
    return c
