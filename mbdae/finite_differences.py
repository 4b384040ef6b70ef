"""Sixth-order finite differences, for functions without exact derivatives.

    f'(0) = (45 (f(h) - f(-h)) - 9 (f(2h) - f(-2h)) + f(3h) - f(-3h))/(60 h) - h^6 f^(7)/140

and at the end of a range, where values exist on one side only, the one-sided formula

    f'(0) = (360 f(h) - 450 f(2h) + 400 f(3h) - 225 f(4h) + 72 f(5h) - 10 f(6h) - 147 f(0))/(60 h) + h^6 f^(7)/7

Source: Fornberg (1988), Generation of finite difference formulas on arbitrarily spaced grids, Math. Comp. 51.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from .errors import MbdaeError
from .system import Array
from .tolerances import AGREEMENT, ROUNDING

WEIGHTS = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # by k: weights of f(k h) - f(-k h), times h
ONE_SIDED = {1: 6.0, 2: -15 / 2, 3: 20 / 3, 4: -15 / 4, 5: 6 / 5, 6: -1 / 6}  # by k: weights of f(k h) - f(0), times h
STENCIL = (-3, -2, -1, 1, 2, 3)  # values of k of central differences
AFFINE_STENCIL = (-3, 3)  # values of k for affine functions
ABOVE, BELOW = (0, 1, 2, 3, 4, 5, 6), (0, -1, -2, -3, -4, -5, -6)  # values of k of one-sided differences
REDUCTION, MAX_REDUCTIONS = 8.0, 6  # factor by which a width is reduced, and largest number of reductions


def central_difference(values: Mapping[int, Any], h: float) -> Any:
    """Return the derivative from values at k h, numbers or arrays; exactly zero where the values are equal.

    Args:
        values: values by k, for all k of `STENCIL`, `ABOVE` or `BELOW`; for affine functions, of `AFFINE_STENCIL`.
        h: width of the differences.
    """
    if len(values) == len(AFFINE_STENCIL):
        return (values[AFFINE_STENCIL[1]] - values[AFFINE_STENCIL[0]]) / ((AFFINE_STENCIL[1] - AFFINE_STENCIL[0]) * h)
    if 0 not in values:
        return sum((w / h) * (values[k] - values[-k]) for k, w in WEIGHTS.items())
    side = 1 if 1 in values else -1
    return sum((side * w / h) * (values[side * k] - values[0]) for k, w in ONE_SIDED.items())


def weights(points: Iterable[int], h: float) -> dict[int, float]:
    """Return the weights with which `central_difference` multiplies the values at the points k h."""
    return {k: float(central_difference({i: float(i == k) for i in points}, h)) for k in points}


def numerical_derivative(value: Callable[[float], Any], h: float) -> Any:
    """Return the derivative of value: x -> number or array at x = 0, from points h apart."""
    return central_difference({k: value(k * h) for k in STENCIL}, h)


def numerical_jacobian(value: Callable[[Array], float | Array], n: int, h: float | Array) -> Array:
    """Return the partial derivatives of value: x (n,) -> (...) at x = 0, (..., n), with widths h, a number or (n,)."""
    directions = zip(np.eye(n), np.broadcast_to(h, n).tolist(), strict=True)
    return np.stack([numerical_derivative(lambda x, e=e: value(x * e), w) for e, w in directions], axis=-1)  # type: ignore[misc]


class ConvergedDifference(NamedTuple):
    """A derivative (n, ...), the width h, and the relative discrepancy from the derivative at another width."""

    derivative: Array
    h: float
    discrepancy: float


def converged_difference(
    values: Callable[[float], Mapping[int, Array]], h: float, noise: float | Array = 0.0, times: int = MAX_REDUCTIONS
) -> ConvergedDifference:
    """Return the derivative of arrays, for a width at which it agrees with the derivative for the next smaller width.

    If the values are affine to rounding, the largest width gives the exact derivative.

    Args:
        values: function of a width h that returns arrays (n, ...) at k h, as for `central_difference`.
        h: the largest width.
        noise: error of each value, in addition to rounding; one number, or (n,).
        times: largest number of reductions of the width.

    Raises:
        MbdaeError: the error for the smallest width, if values cannot be computed for any width.
    """
    last, best, smallest = None, None, np.inf  # type: ConvergedDifference | None, ConvergedDifference | None, float
    for i in range(times + 1):
        try:
            samples = values(h)
        except MbdaeError:
            if i == times and last is None:
                raise
        else:
            derivative = np.asarray(central_difference(samples, h))
            error = noise + ROUNDING * np.abs([*samples.values()]).max(initial=0.0)
            if last is None and 0 not in samples and (_nonlinearity(samples) <= error).all():
                return ConvergedDifference(derivative, h, 0.0)  # exact for any width
            if last:
                change, size = _row_maxima(derivative - last.derivative), _row_maxima(derivative)
                excess = change - error / h
                relative_excess = float(np.max(excess / np.where(size > 0, size, 1.0), initial=0.0))
                discrepancy = float(max(excess.max(initial=0.0), 0.0) / (size.max(initial=0.0) or 1.0))
                if relative_excess <= AGREEMENT:
                    return last._replace(discrepancy=discrepancy)
                if relative_excess < smallest:
                    best, smallest = ConvergedDifference(derivative, h, discrepancy), relative_excess
            last = ConvergedDifference(derivative, h, np.inf)
        h /= REDUCTION
    assert last
    return best or last


def _nonlinearity(samples: Mapping[int, Array]) -> Array:
    """Return the largest distance of values (n, ...) from the line through the outermost two, (n,)."""
    a, b = AFFINE_STENCIL
    line = {k: (samples[b] * (k - a) + samples[a] * (b - k)) / (b - a) for k in samples}
    return np.max([_row_maxima(np.asarray(samples[k] - line[k])) for k in samples], axis=0)


def _row_maxima(x: Array) -> Array:
    """Return the largest magnitude in each row, (n,)."""
    return np.abs(x).reshape(len(x), -1).max(axis=1, initial=0.0) if x.ndim else np.abs(x)[None]
