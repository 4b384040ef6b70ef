"""How well data determine parameters: standard deviations, correlations, and groups that they do not identify."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...system import Array
from ...tolerances import RANK
from .result import TIED

SHARE = 0.1  # of a null vector: parameters with as much are in the combination that is not told
DETERMINED = 1e-2  # of the range between the bounds: a larger deviation of two parameters ties them together


class Precision(NamedTuple):
    """The precision of k parameters: see `mbdae.studies.fit.result.Fit`."""

    covariance: Array
    correlations: Array
    deviations: Array
    untold: list[tuple[str, ...]]


def precision(J: Array, names: Sequence[str], scale: Array, widths: Array, variance: float) -> Precision:
    """The precision of parameters from the Jacobian of the residuals.

    Args:
        J: (n, k) by parameters in their scales.
        names: of the parameters.
        scale: of the parameters, (k,).
        widths: of their ranges between the bounds, (k,).
        variance: of a residual.
    """
    _, sizes, V = np.linalg.svd(J, full_matrices=False)
    kept = sizes > RANK * sizes.max(initial=0.0)
    null = V[~kept] if len(V) == len(names) else np.eye(len(names))
    covariance = (V[kept].T / sizes[kept] ** 2) @ V[kept] * np.outer(scale, scale) * variance
    deviations = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = covariance / np.outer(deviations, deviations)
    combinations = [np.abs(row) > SHARE for row in null]
    for combination in combinations:
        deviations[combination] = np.inf
    untold = [members(names, combination) for combination in combinations]
    uncertain = members(names, (widths < deviations) & (deviations < np.inf))
    untold += [(name,) for name in uncertain]
    untold += [(names[i], names[j]) for i, j in _tied(correlations, deviations / widths)]
    return Precision(covariance, correlations, deviations, list(dict.fromkeys(untold)))


def members(names: Sequence[str], chosen: Array) -> tuple[str, ...]:
    """The names where a mask (k,) is true."""
    return tuple(name for name, is_member in zip(names, chosen, strict=True) if is_member)


def _tied(correlations: Array, deviations: Array) -> Iterator[tuple[int, int]]:
    """Pairs of parameters of which the data tell a combination; deviations in ranges between the bounds."""
    for j in range(len(deviations)):
        for i in range(j):
            if abs(correlations[j, i]) > TIED and min(deviations[i], deviations[j]) > DETERMINED:
                yield i, j
