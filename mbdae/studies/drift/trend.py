"""Linear trend of a quantity that oscillates."""

import numpy as np

from ...system import Array

BLOCKS = 50  # number of blocks of equal duration
LARGEST_CORRELATION = 0.95  # correlation of successive means: with larger ones the standard error has no meaning


def linear_trend(t: Array, x: Array) -> tuple[float, float] | None:
    """Return the trend of x(t) and its standard error, by regression of means over `BLOCKS` blocks between nodes.

    A quantity without trend has one of 0 within three standard errors. With the correlation r of successive means,
    as in oscillations slower than a block, the standard error is that of independent means times
    ((1 + r) / (1 - r))^(1/2).

    Source: Priestley, Spectral Analysis and Time Series (1981), section 5.3, for residuals of first order.

    Args:
        t: increasing or decreasing times, (n,).
        x: values, (n,), linear in between.

    Returns:
        None for fewer than two values in each block.
    """
    if len(t) < 2 * BLOCKS:
        return None
    integral = np.concatenate([[0.0], np.cumsum(np.diff(t) * (x[1:] + x[:-1]) / 2)])
    sign = np.sign(t[-1] - t[0])
    at = np.searchsorted(sign * t[:-1], sign * np.linspace(t[0], t[-1], BLOCKS + 1))
    at = at[np.diff(at, prepend=-1) > 0]  # np.unique imports numpy.ma, a thirtieth of a first run
    means, middle = np.diff(integral[at]) / np.diff(t[at]), (t[at][1:] + t[at][:-1]) / 2
    middle = middle - middle.mean()
    trend = middle @ means / (middle @ middle)
    left = means - means.mean() - trend * middle
    power = left @ left
    r = min(max(left[1:] @ left[:-1] / power, 0.0), LARGEST_CORRELATION) if power else 0.0
    return float(trend), float(np.sqrt(power / (len(means) - 2) / (middle @ middle) * (1 + r) / (1 - r)))
