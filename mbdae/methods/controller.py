"""Step-size control: sees error vectors and step sizes, knows no problem and no method."""

from dataclasses import dataclass

import numpy as np

SAFETY, SMALLEST, LARGEST, BETA = 0.9, 0.2, 10.0, 0.04
SMALLEST_ERROR, SMALLEST_LAST = 1e-10, 1e-4  # errors below count as these: of a step, and of the one before
COMPANION = 0.01  # weight of the second of two error estimates


def error_norm(errors: np.ndarray, scale: np.ndarray) -> float:
    """Weighted root mean square of the error vectors, (k, m) over scale (m,); a step is accepted below 1.

    One vector gives its norm err. Two vectors (an embedded formula and a companion of lower order) give
    err_1^2 / (err_1 + 0.01 err_2), which is small where both formulas agree that it should be (Brasey 1992, HEM5;
    Hairer, Noersett, Wanner I, (II.10.17)).
    """
    norms = np.sqrt(np.mean((errors / scale) ** 2, axis=1))
    if len(norms) == 1 or norms[0] == 0:
        return float(norms[0])
    return float(norms[0] ** 2 / (norms[0] + COMPANION * norms[1]))


@dataclass
class Controller:
    """PI controller h_new = 0.9 h err^(-1/k + 0.75 beta) err_last^beta, within a fifth and ten times h.

    k is the power of h in the error estimate. A rejected step does not count as the last one, and the step after it
    does not grow (Gustafsson 1991; Hairer, Wanner II, (IV.2.43)).
    """

    power: int
    last: float = SMALLEST_LAST
    rejected: bool = False

    @property
    def beta(self) -> float:
        """The exponent of the last error; 0 for estimates of low order."""
        return BETA if self.power > 2 else 0.0

    @property
    def exponent(self) -> float:
        """The exponent of the error of an accepted step."""
        return 0.75 * self.beta - 1 / self.power

    def next_step(self, h: float, err: float) -> float:
        """Return the step to take after one of size h with error norm err (accepted when err <= 1)."""
        if not err <= 1:
            self.rejected = True
            shrink = SAFETY * err ** (-1 / self.power) if np.isfinite(err) else 0.0
            return h * max(SMALLEST, shrink)
        err = max(err, SMALLEST_ERROR)
        factor = SAFETY * err**self.exponent * self.last**self.beta
        factor = min(1.0 if self.rejected else LARGEST, max(SMALLEST, factor))
        self.last, self.rejected = max(err, SMALLEST_LAST), False
        return h * factor
