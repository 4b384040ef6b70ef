"""Coefficients of the Radau IIA methods with any number of stages, from their nodes.

The nodes c_1 < ... < c_s = 1 are the zeros of

    d^(s-1)/dx^(s-1) [x^(s-1) (x - 1)^s],

and collocation gives a_ij = integral of l_j from 0 to c_i with the Lagrange polynomials l_j of the nodes: the
assumption C(s). All numbers are computed to 40 digits and rounded once.

Source: Hairer, Wanner, Solving Ordinary Differential Equations II, section IV.5.
"""

from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache, cached_property
from math import comb, perm

import numpy as np

from .stage_arrays import StageArrays, stage_arrays

DIGITS = 40

Polynomial = list[Decimal]  # coefficients of 1, x, x^2, ...


@dataclass(frozen=True)
class Coefficients:
    """Nodes c (s,) and coefficients A (s, s) to 40 digits; the weights are the last row of A."""

    c: tuple[Decimal, ...]
    A: tuple[tuple[Decimal, ...], ...]

    @cached_property
    def arrays(self) -> StageArrays:
        """The coefficients in double precision."""
        A = np.array(self.A, float)
        return stage_arrays(np.array(self.c, float), A, A[-1], R_infinity=0.0)


@cache
def coefficients(s: int) -> Coefficients:
    """Return nodes and coefficients of the method with s stages."""
    with localcontext() as context:
        context.prec = DIGITS + 20 + 4 * s  # cancellation in polynomials of degree s costs about 2 s digits
        c = _nodes(s)
        A = _collocation(c)
        context.prec = DIGITS
        return Coefficients(tuple(+x for x in c), tuple(tuple(+x for x in row) for row in A))


def _nodes(s: int) -> list[Decimal]:
    """Compute the zeros by Newton's method from those of the Jacobi polynomial P^(1,0) of degree s - 1.

    These are eigenvalues of the matrix of its recurrence (Golub, Welsch, Math. Comp. 23 (1969)).
    """
    power = [Decimal(comb(s, k) * (-1) ** (s - k)) for k in range(s + 1)]  # (x - 1)^s; x^(s-1) shifts it
    p = [perm(k + s - 1, s - 1) * a for k, a in enumerate(power)]
    dp = [k * a for k, a in enumerate(p)][1:]
    k = np.arange(1, s)
    off_diagonal = np.sqrt(k * (k + 1)) / (2 * k + 1)
    recurrence = np.diag(-1.0 / (4 * k**2 - 1)) + np.diag(off_diagonal[:-1], 1) + np.diag(off_diagonal[:-1], -1)
    guesses = (np.linalg.eigvalsh(recurrence) + 1) / 2
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
        scale = _value(basis, node)
        columns.append([_value(integral, x) / scale for x in c])
    return [list(row) for row in zip(*columns, strict=True)]


def _value(p: Polynomial, x: Decimal) -> Decimal:
    value = Decimal(0)
    for a in reversed(p):
        value = value * x + a
    return value
