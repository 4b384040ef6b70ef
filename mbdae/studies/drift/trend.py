"""Linear trend of a quantity that oscillates."""

import numpy as np

from ...system import Array

BLOCKS = 50  # number of blocks of equal duration
LARGEST_CORRELATION = 0.95  # correlation of successive residuals, above which the standard error is meaningless


def linear_trend(t: Array, x: Array) -> tuple[float, float] | None:
    """Return the trend of x(t) and its standard error, by regression of means over `BLOCKS` blocks between nodes.

    The trend of a stationary quantity is rarely more than three standard errors. With the correlation r of successive
    residuals, as in oscillations slower than a block, the standard error is that of independent means times
    ((1 + r) / (1 - r))^(1/2).

    Source: Priestley, Spectral Analysis and Time Series (1981), section 5.3, for first-order autoregressive
    residuals.

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
    nodes = np.searchsorted(sign * t[:-1], sign * np.linspace(t[0], t[-1], BLOCKS + 1))
    nodes = nodes[np.diff(nodes, prepend=-1) > 0]  # np.unique imports numpy.ma, 3 % of the time of a first run
    means, midpoints = np.diff(integral[nodes]) / np.diff(t[nodes]), (t[nodes][1:] + t[nodes][:-1]) / 2
    midpoints = midpoints - midpoints.mean()
    trend = midpoints @ means / (midpoints @ midpoints)
    residual = means - means.mean() - trend * midpoints
    power = residual @ residual
    r = min(max(residual[1:] @ residual[:-1] / power, 0.0), LARGEST_CORRELATION) if power else 0.0
    return float(trend), float(np.sqrt(power / (len(means) - 2) / (midpoints @ midpoints) * (1 + r) / (1 - r)))
