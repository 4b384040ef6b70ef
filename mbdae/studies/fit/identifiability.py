"""Identifiability of parameters: standard deviations, correlations, and groups that the data do not determine."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...system import Array
from ...tolerances import RANK
from .result import MAX_CORRELATION

NULL_COMPONENT = 0.1  # components of a unit null vector above it form the unidentifiable combination
DETERMINED = 1e-2  # standard deviation over the range between the bounds, below which a parameter is identified singly


class Precision(NamedTuple):
    """Precision of k parameters, see `mbdae.studies.fit.result.Fit`."""

    covariance: Array
    correlations: Array
    deviations: Array
    unidentifiable: list[tuple[str, ...]]


def precision(
    J: Array, names: Sequence[str], scale: Array, widths: Array, r: Array, signals: Array | None
) -> Precision:
    """Return the precision of parameters from the residuals and their Jacobian.

    Args:
        J: Jacobian with respect to the scaled parameters, (n, k).
        names: names of the parameters.
        scale: scales of the parameters, (k,).
        widths: ranges between the bounds, (k,).
        r: residuals, (n,).
        signals: index of the signal of each residual, (n,), if each signal has its own unknown variance; None if all
            variances are 1.
    """
    U, singular_values, V = np.linalg.svd(J, full_matrices=False)
    determined = singular_values > RANK * singular_values.max(initial=0.0)
    null = V[~determined] if len(V) == len(names) else np.eye(len(names))
    U, inverse = U[:, determined], V[determined].T / singular_values[determined]
    variances = np.ones(len(r)) if signals is None else _variances(r, signals, (U * U).sum(1), len(names))
    covariance = inverse @ (U.T * variances) @ U @ inverse.T * np.outer(scale, scale)
    combinations = [np.abs(row) > NULL_COMPONENT for row in null]
    free = np.any([np.zeros(len(names), bool), *combinations], axis=0)
    covariance[free], covariance[:, free] = np.nan, np.nan  # the pseudo-inverse depends on the scales
    covariance[free, free] = np.inf
    deviations = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = covariance / np.outer(deviations, deviations)
    unidentifiable = [members(names, combination) for combination in combinations]
    uncertain = members(names, (widths < deviations) & (deviations < np.inf))
    unidentifiable += [(name,) for name in uncertain]
    unidentifiable += [(names[i], names[j]) for i, j in _correlated_pairs(correlations, deviations / widths)]
    return Precision(covariance, correlations, deviations, list(dict.fromkeys(unidentifiable)))


def _variances(r: Array, signals: Array, leverages: Array, k: int) -> Array:
    """Return the variances of residuals (n,), one for each signal: its sum of squares over its degrees of freedom.

    A signal with less than one degree of freedom has the variance of all signals; without any, variances are 1.
    """
    squares, dof = np.bincount(signals, r * r), np.bincount(signals, 1.0 - leverages)
    mean = squares.sum() / (len(r) - k) if len(r) > k else 1.0
    return np.divide(squares, dof, out=np.full(len(dof), mean), where=(dof >= 1.0) & (len(r) > k))[signals]


def members(names: Sequence[str], chosen: Array) -> tuple[str, ...]:
    """Return the names for which a mask (k,) is true."""
    return tuple(name for name, is_member in zip(names, chosen, strict=True) if is_member)


def _correlated_pairs(correlations: Array, deviations: Array) -> Iterator[tuple[int, int]]:
    """Yield pairs of which only a combination is determined; deviations are relative to the bounds."""
    for j in range(len(deviations)):
        for i in range(j):
            if abs(correlations[j, i]) > MAX_CORRELATION and min(deviations[i], deviations[j]) > DETERMINED:
                yield i, j
