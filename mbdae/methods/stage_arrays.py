"""Coefficients of an implicit method in double precision, and the eigenvectors of A."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..system import Array
from ..tolerances import INPUT_DIGITS, SUM_ROUNDING

SEPARATION = INPUT_DIGITS  # fraction of an eigenvalue: shift of multiple eigenvalues, see `stage_arrays`


class EigenMode(NamedTuple):
    """An eigenvalue of A with its eigenvector ``column`` (s,) and the matching ``row`` (s,) of the inverse.

    One mode represents a complex pair (its column is doubled), so that A x = Re sum column * value * (row . x).
    """

    value: float | complex
    column: Array
    row: Array


@dataclass(frozen=True)
class StageArrays:
    """Coefficients of an implicit method in double precision.

    Attributes:
        c: nodes, (s,).
        A: coefficients, (s, s).
        b: weights of y_1, (s,).
        z_weights: sum_i b_i omega_ij, omega the inverse of A: weights of the stages in z_1, (s,).
        R_infinity: R(infinity) = 1 - sum_ij b_i omega_ij, the weight of z_0 in z_1.
        ends_at_stage: whether b is the last row of A, so that (y_1, z_1) is the last stage.
        modes: real eigenvalues and complex pairs of A.
        real: index of the first real mode; None if there is none.
        gamma: a real eigenvalue of A, or the geometric mean of all: the weight of y'_0 in the error estimate.
        start: the Lagrange polynomials of the nodes at 0, and for s >= 3 of all nodes except the first, (1 or 2, s).
        middle: index of the node closest to 1/2.
    """

    c: Array
    A: Array
    b: Array
    z_weights: Array
    R_infinity: float
    ends_at_stage: bool
    modes: tuple[EigenMode, ...]
    real: int | None
    gamma: float
    start: Array
    middle: int


def stage_arrays(c: Array, A: Array, b: Array, R_infinity: float) -> StageArrays:
    """Return the arrays of a method.

    A with a multiple eigenvalue (SDIRK) has no basis of eigenvectors. Its modes are those of a matrix whose diagonal
    differs by multiples of a millionth; the simplified Newton iteration converges to the stages of A nevertheless.

    Args:
        c: nodes, (s,).
        A: coefficients, (s, s), nonsingular.
        b: weights, (s,).
        R_infinity: R(infinity).
    """
    values, T = np.linalg.eig(A)
    distances = np.abs(values[:, None] - values)[np.triu_indices(len(c), 1)]
    if (distances < np.sqrt(SUM_ROUNDING) * np.abs(values).max()).any():
        values, T = np.linalg.eig(A * (1 + SEPARATION * np.diag(np.arange(len(c)))))
    modes = []
    for value, column, row in zip(values, T.T, np.linalg.inv(T), strict=True):
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
    ends_at_stage = bool((b == A[-1]).all())
    last = np.eye(len(c))[-1] if ends_at_stage else np.linalg.solve(A.T, b)
    return StageArrays(c, A, b, last, R_infinity, ends_at_stage, tuple(modes), real, gamma, np.array(start), middle)


def lagrange(c: Array, x: Array) -> Array:
    """Return the Lagrange polynomials of the nodes c (s,) at the points x (n,), as (n, s)."""
    others = ~np.eye(len(c), dtype=bool)
    factors = (x[:, None, None] - c) / np.where(others, c[:, None] - c, 1.0)
    return np.prod(np.where(others, factors, 1.0), axis=2)
