"""Central differences of order six, for what has no derivative of its own.

    f'(0) = (45 (f(h) - f(-h)) - 9 (f(2h) - f(-2h)) + f(3h) - f(-3h))/(60 h) - h^6 f^(7)/140

Source: Fornberg (1988), Generation of finite difference formulas on arbitrarily spaced grids, Math. Comp. 51.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .system import Array

WEIGHTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # k: of f(k h) - f(-k h), over h
PLACES = (-3, -2, -1, 1, 2, 3)  # all k


def quotient(values: Mapping[int, Any], h: float) -> Any:
    """Return the slope of numbers or arrays known at k h, k in `PLACES`; exactly zero where they do not change."""
    return sum((w / h) * (values[k] - values[-k]) for k, w in WEIGHTS.items())


def slope(value: Callable[[float], Any], h: float) -> Any:
    """Return the slope of value: x -> number or array at x = 0 from places h apart."""
    return quotient({k: value(k * h) for k in PLACES}, h)


def slopes(value: Callable[[Array], Any], n: int, h: float) -> Array:
    """Return the slopes of value: x (n,) -> (...) at x = 0 along each coordinate, (..., n)."""
    return np.stack([slope(lambda x, e=e: value(x * e), h) for e in np.eye(n)], axis=-1)  # type: ignore[misc]
