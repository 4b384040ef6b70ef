"""Coefficients of the Radau IIA methods with any number of stages, from their nodes.

The nodes c_1 < ... < c_s = 1 are the zeros of

    d^(s-1)/dx^(s-1) [x^(s-1) (x - 1)^s],

and collocation gives a_ij = integral of l_j from 0 to c_i with the Lagrange polynomials l_j of the nodes: the
assumption C(s). Everything is computed to 40 digits and rounded once.

Source: Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.5.
"""

from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache, cached_property
from math import comb, perm
from typing import NamedTuple

import numpy as np
from scipy.special import roots_jacobi

from ..system import Array

DIGITS = 40

Polynomial = list[Decimal]  # coefficients of 1, x, x^2, ...


class EigenMode(NamedTuple):
    """An eigenvalue of A with its eigenvector ``column`` (s,) and the matching ``row`` (s,) of the inverse.

    One mode represents a complex pair (its column is doubled), so that A x = Re sum column * value * (row . x).
    """

    value: float | complex
    column: Array
    row: Array


@dataclass(frozen=True)
class Coefficients:
    """Nodes c (s,) and coefficients A (s, s) to 40 digits; the weights are the last row of A."""

    c: tuple[Decimal, ...]
    A: tuple[tuple[Decimal, ...], ...]

    @cached_property
    def arrays(self) -> "RadauArrays":
        """Data of a step, in double precision."""
        c, A = np.array(self.c, float), np.array(self.A, float)
        values, T = np.linalg.eig(A)
        rows = np.linalg.inv(T)
        modes = []
        for value, column, row in zip(values, T.T, rows, strict=True):
            if value.imag == 0:
                modes.append(EigenMode(float(value.real), column.real, row.real))
            elif value.imag > 0:
                modes.append(EigenMode(complex(value), 2 * column, row))
        real = next((i for i, mode in enumerate(modes) if isinstance(mode.value, float)), None)
        gamma = float(np.linalg.det(A) ** (1 / len(c))) if real is None else modes[real].value.real
        start = [lagrange(c, np.zeros(1))[0]]
        if len(c) >= 3:
            start.append(np.append(0.0, lagrange(c[1:], np.zeros(1))))
        middle = int(np.argmin(np.abs(c - 0.5)))
        return RadauArrays(c, A, tuple(modes), real, gamma, np.array(start), middle)


@dataclass(frozen=True)
class RadauArrays:
    """Double-precision data of a step.

    Attributes:
        c: nodes, (s,).
        A: coefficients, (s, s).
        modes: real eigenvalues and complex pairs of A.
        real: index of the real mode; None if s is even.
        gamma: the real eigenvalue of A, or the geometric mean of all: the weight of y'_0 in the error estimate.
        start: the Lagrange polynomials of the nodes at 0, and for s >= 3 of all but the first node, (1 or 2, s).
        middle: index of the node next to 1/2.
    """

    c: Array
    A: Array
    modes: tuple[EigenMode, ...]
    real: int | None
    gamma: float
    start: Array
    middle: int


@cache
def coefficients(s: int) -> Coefficients:
    """Return nodes and coefficients of the method with s stages."""
    with localcontext() as context:
        context.prec = DIGITS + 20 + 4 * s  # cancellation in polynomials of degree s costs about 2 s digits
        c = _nodes(s)
        A = _collocation(c)
        context.prec = DIGITS
        return Coefficients(tuple(+x for x in c), tuple(tuple(+x for x in row) for row in A))


def lagrange(c: Array, x: Array) -> Array:
    """Return the Lagrange polynomials of the nodes c (s,) at the points x (n,), as (n, s)."""
    others = ~np.eye(len(c), dtype=bool)
    factors = (x[:, None, None] - c) / np.where(others, c[:, None] - c, 1.0)
    return np.prod(np.where(others, factors, 1.0), axis=2)


def _nodes(s: int) -> list[Decimal]:
    """Compute the zeros by Newton's method from those of the Jacobi polynomial P^(1,0) of degree s - 1."""
    power = [Decimal(comb(s, k) * (-1) ** (s - k)) for k in range(s + 1)]  # (x - 1)^s; x^(s-1) shifts it
    p = [perm(k + s - 1, s - 1) * a for k, a in enumerate(power)]
    dp = [k * a for k, a in enumerate(p)][1:]
    guesses = (roots_jacobi(s - 1, 1, 0)[0] + 1) / 2 if s > 1 else []
    return [_zero(p, dp, Decimal(float(x))) for x in guesses] + [Decimal(1)]


def _zero(p: Polynomial, dp: Polynomial, x: Decimal) -> Decimal:
    for _ in range(6):  # 15, 30, 60, ... digits
        x -= _value(p, x) / _value(dp, x)
    return x


def _collocation(c: list[Decimal]) -> list[list[Decimal]]:
    columns = []
    for j, node in enumerate(c):
        basis = [Decimal(1)]
        for other in c[:j] + c[j + 1 :]:
            basis = [a - other * b for a, b in zip([Decimal(0), *basis], [*basis, Decimal(0)], strict=True)]
        integral = [Decimal(0), *(a / (k + 1) for k, a in enumerate(basis))]
        size = _value(basis, node)
        columns.append([_value(integral, x) / size for x in c])
    return [list(row) for row in zip(*columns, strict=True)]


def _value(p: Polynomial, x: Decimal) -> Decimal:
    value = Decimal(0)
    for a in reversed(p):
        value = value * x + a
    return value
