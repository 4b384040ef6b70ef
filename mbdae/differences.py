"""Central differences of order six, for what has no derivative of its own.

    f'(0) = (45 (f(h) - f(-h)) - 9 (f(2h) - f(-2h)) + f(3h) - f(-3h))/(60 h) - h^6 f^(7)/140

Source: Fornberg (1988), Generation of finite difference formulas on arbitrarily spaced grids, Math. Comp. 51.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from .errors import MbdaeError
from .system import Array

WEIGHTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # k: of f(k h) - f(-k h), over h
PLACES = (-3, -2, -1, 1, 2, 3)  # all k
NARROWER, TIMES = 8.0, 6  # how much, and how often a width shrinks
AGREE = 1e-10  # of a slope: what two widths may differ by
ROUNDING = 1e-15  # of the largest value: what closes is a difference of such ones


def quotient(values: Mapping[int, Any], h: float) -> Any:
    """Return the slope of numbers or arrays known at k h, k in `PLACES`; exactly zero where they do not change."""
    return sum((w / h) * (values[k] - values[-k]) for k, w in WEIGHTS.items())


def slope(value: Callable[[float], Any], h: float) -> Any:
    """Return the slope of value: x -> number or array at x = 0 from places h apart."""
    return quotient({k: value(k * h) for k in PLACES}, h)


def slopes(value: Callable[[Array], Any], n: int, h: float) -> Array:
    """Return the slopes of value: x (n,) -> (...) at x = 0 along each coordinate, (..., n)."""
    return np.stack([slope(lambda x, e=e: value(x * e), h) for e in np.eye(n)], axis=-1)  # type: ignore[misc]


class Settled(NamedTuple):
    """A slope (n, ...), the width of its differences, and how far another width is from it, relative to the largest."""

    slope: Array
    h: float
    apart: float


def settled(
    values: Callable[[float], Mapping[int, Array]], h: float, noise: float = 0.0, times: int = TIMES
) -> Settled:
    """Return the slope of arrays with a width small enough for it: where narrower differences say the same.

    Args:
        values: the arrays (n, ...) at k h, by k in `PLACES`, for a width h.
        h: the widest.
        noise: error of each value, beside rounding.
        times: how often the width shrinks at most.

    Raises:
        MbdaeError: what the narrowest values raise, where none can be computed.
    """
    last, best, least = None, None, np.inf  # type: Settled | None, Settled | None, float
    for i in range(times + 1):
        try:
            found = values(h)
        except MbdaeError:
            if i == times and last is None:
                raise
        else:
            slope = np.asarray(quotient(found, h))
            if last:
                gap, size, value = _rows(slope - last.slope), _rows(slope), np.abs([*found.values()]).max(initial=0.0)
                excess = gap - (noise + ROUNDING * value) / h
                miss = float(np.max(excess / np.where(size > 0, size, 1.0), initial=0.0))
                apart = float(max(excess.max(initial=0.0), 0.0) / (size.max(initial=0.0) or 1.0))
                if miss <= AGREE:
                    return last._replace(apart=apart)
                if miss < least:
                    best, least = Settled(slope, h, apart), miss
            last = Settled(slope, h, np.inf)
        h /= NARROWER
    assert last
    return best or last


def _rows(x: Array) -> Array:
    """The largest magnitude in each row, (n,)."""
    return np.abs(x).reshape(len(x), -1).max(axis=1, initial=0.0) if x.ndim else np.abs(x)[None]
