"""Step-size control from error vectors and step sizes, independent of problem and method."""

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from ..tolerances import AGREEMENT, COARSE


class Control(NamedTuple):
    """Control parameters: the exponent of the previous error, and the smallest and largest step-size ratio."""

    beta: float
    smallest: float
    largest: float


PI = Control(beta=0.04, smallest=0.2, largest=10.0)
SAFETY = 0.9
SMALLEST_ERROR, SMALLEST_LAST = AGREEMENT, COARSE  # lower bounds of the errors of a step and of the previous step
COMPANION_WEIGHT = 0.01  # weight of the second of two error estimates


def error_norm(errors: np.ndarray, scale: np.ndarray, blend: float = 1.0) -> float:
    """Return the weighted root mean square of error vectors (k, m) relative to scale (m,); 1 is accepted.

    For one vector this is its norm err. For two vectors (an embedded formula and a companion of lower order) it is
    err_1^2 / (err_1^p + 0.01 err_2^p)^(1/p), which is small if both formulas are accurate: p = 1 in HEM5 (Brasey 1992),
    2 in DOP853 (Hairer, Noersett, Wanner I, (II.10.17)).

    Args:
        errors: the error vectors.
        scale: scale of each component.
        blend: the exponent p.
    """
    first, *companion = root_mean_squares(errors / scale)
    if not companion or first**2 == 0:
        return first
    return first**2 / (first**blend + COMPANION_WEIGHT * companion[0] ** blend) ** (1 / blend)


def root_mean_squares(x: np.ndarray) -> list[float]:
    """Return the root mean squares of the rows of x, (k, m)."""
    return [sqrt(row.dot(row) / len(row)) for row in x]  # faster than `numpy.mean` on small arrays


@dataclass
class Controller:
    """PI controller h_new = 0.9 h err^(-1/k + 0.75 beta) err_last^beta, by default between 0.2 h and 10 h.

    k is the power of h in the error estimate. A rejected step does not change err_last, and the step size does not grow
    after it (Gustafsson 1991; Hairer, Wanner II, (IV.2.43)). Growth by a factor below ``min_growth`` is suppressed, to
    reuse data that depend on h (Hairer, Wanner II, section IV.8).
    """

    power: int
    control: Control = PI
    min_growth: float = 1.0
    last: float = SMALLEST_LAST
    rejected: bool = False

    @property
    def beta(self) -> float:
        """Exponent of the previous error; 0 for estimates of low order."""
        return self.control.beta if self.power > 2 else 0.0

    @property
    def exponent(self) -> float:
        """Exponent of the error of an accepted step."""
        return 0.75 * self.beta - 1 / self.power

    def next_step(self, h: float, err: float) -> float:
        """Return the next step size after a step of size h with error norm err (accepted if err <= 1)."""
        if not err <= 1:
            self.rejected = True
            shrink = SAFETY * err ** (-1 / self.power) if np.isfinite(err) else 0.0
            return h * max(self.control.smallest, shrink)
        err = max(err, SMALLEST_ERROR)
        factor = SAFETY * err**self.exponent * self.last**self.beta
        factor = min(1.0 if self.rejected else self.control.largest, max(self.control.smallest, factor))
        if 1 < factor <= self.min_growth:
            factor = 1.0
        self.last, self.rejected = max(err, SMALLEST_LAST), False
        return h * factor
