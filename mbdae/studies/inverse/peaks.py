"""Peaks of sampled values between samples, and integrals of positive and negative parts."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...system import Array
from ...tolerances import INTERPOLATION

HALF_WIDTH = 3  # samples on each side of the largest sample: the polynomial has degree 6


def located_peak(values: Array, t: Array, over: Array, intervals: Sequence[Array]) -> tuple[float, float]:
    """Return the largest magnitude of values (n,) over t, and its position on an abscissa ``over`` (n,).

    If polynomials of degrees 4 and 6 through the nearest samples agree at the peak, it is that of the latter; close to
    jumps, corners and ends it is the largest sample.

    Args:
        values: samples, (n,).
        t: times, (n,).
        over: the abscissa, (n,).
        intervals: indices of the samples between jumps, increasing.
    """
    i = int(np.abs(values).argmax())
    sample = float(abs(values[i])), float(over[i])
    if not any(k[0] <= i - HALF_WIDTH and i + HALF_WIDTH <= k[-1] for k in intervals):
        return sample
    fits = [_polynomial(values, t, i, half_width) for half_width in (HALF_WIDTH, HALF_WIDTH - 1)]
    h = np.diff(t[i - 1 : i + 2])
    low, high = -h[0] / h.mean(), h[1] / h.mean()
    roots = fits[0].deriv().roots()
    inside = roots.real[(np.abs(roots.imag) < INTERPOLATION) & (low <= roots.real) & (roots.real <= high)]
    if not len(inside):
        return sample
    x = float(inside[np.abs(fits[0](inside)).argmax()])
    value, check = (abs(float(p(x))) for p in fits)
    if not (abs(value - check) <= INTERPOLATION * value and value >= sample[0]):
        return sample
    return value, float(_polynomial(over, t, i, HALF_WIDTH)(x))


def _polynomial(values: Array, t: Array, i: int, half_width: int) -> np.polynomial.Polynomial:
    """Return the polynomial through 2 half_width + 1 samples around sample i; its variable is t - t_i in mean steps."""
    window = slice(i - half_width, i + half_width + 1)
    x = (t[window] - t[i]) / np.diff(t[i - 1 : i + 2]).mean()
    return np.polynomial.Polynomial(np.linalg.solve(np.vander(x, increasing=True), values[window]))


def delivered_and_absorbed(power: Array, t: Array, intervals: Sequence[Array]) -> tuple[float, float]:
    """Return the integrals of the positive and of the negative part of a power, by monotone cubics, both >= 0."""
    delivered = absorbed = 0.0
    for k in intervals:
        cubic = PchipInterpolator(t[k], power[k])
        roots = cubic.roots(extrapolate=False)
        cuts = np.unique([t[k[0]], *roots[np.isfinite(roots)], t[k[-1]]])
        energies = np.diff(cubic.antiderivative()(cuts))
        delivered, absorbed = delivered + energies[energies > 0].sum(), absorbed - energies[energies < 0].sum()
    return float(delivered), float(absorbed)
