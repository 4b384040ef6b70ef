"""Termination of Newton's iterations with a few unknowns."""

import numpy as np

from ..system import Array


def largest(x: Array) -> float:
    """Return max |x_i|, for (n,); nan if one is nan."""
    sizes = np.abs(x)
    return float(sizes[sizes.argmax()])  # faster than `numpy.max` on small arrays


def is_last(size: float, last: float, limit: float) -> bool:
    """Return whether the next change of Newton's iteration, estimated as (size / last)^2 size, is below a limit."""
    return last < np.inf and size**3 <= limit * last**2
