"""Piecewise polynomials for constants, polynomials, tables and steps, and smooth curves through points."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from math import floor, isfinite
from typing import TYPE_CHECKING, Literal

import numpy as np

from ...data_types import CoreData
from ...errors import InputError

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Point = tuple[float, float]
Interpolation = Literal["spline", "monotone"]
Extrapolation = Literal["hold", "linear", "periodic"]
CACHE_SIZE = 32  # number of curves
MAX_POLYNOMIALS = 100_000  # largest number of polynomials within a run


class PiecewisePolynomial:
    """u(t) = sum_p c_ip (t - t_i)^(d - p) for t >= t_i; the first polynomial also applies before t_0.

    Args:
        breakpoints: t_i, (n,), increasing: where each polynomial begins.
        coefficients: c, (n, d + 1), highest power first.
        nonsmooth_times: times where u is not smooth.
        period: u(t + period) = u(t) + increment from t_0 on; 0 if u is not periodic.
        increment_per_period: increment of u over one period.
    """

    def __init__(
        self,
        breakpoints: Iterable[float],
        coefficients: Iterable[Iterable[float]],
        nonsmooth_times: Sequence[float] = (),
        period: float = 0.0,
        increment_per_period: float = 0.0,
    ) -> None:
        rows = [[float(c) for c in row] for row in coefficients]
        self.breakpoints, self.nonsmooth_times = [float(t) for t in breakpoints], nonsmooth_times
        self.period, self.increment_per_period = period, increment_per_period
        self._derivatives = [rows]
        for k in range(3):
            self._derivatives.append([_derivative(row) for row in self._derivatives[k]])

    @classmethod
    def from_ppoly(
        cls,
        curve: "PPoly",
        nonsmooth_times: Sequence[float] = (),
        period: float = 0.0,
        increment_per_period: float = 0.0,
    ) -> "PiecewisePolynomial":
        """Return the piecewise polynomial of a scipy `PPoly`."""
        return cls(curve.x[:-1], curve.c.T, nonsmooth_times, period, increment_per_period)

    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative, k = 0, 1, 2, 3."""
        periods = floor((t - self.breakpoints[0]) / self.period) if self.period and isfinite(t) else 0
        t -= periods * self.period
        i = max(0, bisect_right(self.breakpoints, t) - 1)
        row, x = self._derivatives[k][i], t - self.breakpoints[i]
        value = row[0]
        for j in range(1, len(row)):
            value = value * x + row[j]
        return value if k else value + periods * self.increment_per_period

    def derivative(self, t: float, k: int = 1) -> float:
        """Return the k-th derivative, k = 1, 2, 3."""
        return self.at(t, k)

    def knots_between(self, t0: float, t1: float) -> list[float]:
        """Return the knots between t0 and t1: times where two polynomials join.

        Raises:
            InputError: if the period is so short that there are too many.
        """
        low, high = min(t0, t1), max(t0, t1)
        if not self.period:
            return [t for t in self.breakpoints[1:] if low < t < high]
        first, last = (floor((t - self.breakpoints[0]) / self.period) for t in (low, high))
        if (count := (last + 1 - first) * len(self.breakpoints)) > MAX_POLYNOMIALS:
            text = f"a table that repeats every {self.period:g} s has {count:.3g} pieces between {t0:g} and {t1:g} s"
            raise InputError(f"{text}: at most {MAX_POLYNOMIALS} are supported")
        knots = (t + k * self.period for k in range(first, last + 1) for t in self.breakpoints)
        return [t for t in knots if low < t < high]

    def core_data(self) -> CoreData:
        """Return the core data."""
        rows = self._derivatives[0]
        numbers = {"a": [c for row in rows for c in row], "b": self.breakpoints, "degree": len(rows[0]) - 1}
        return {"kind": "polynomials", **numbers, "period": self.period, "rise": self.increment_per_period}


def _derivative(row: list[float]) -> list[float]:
    degree = len(row) - 1
    return [c * (degree - p) for p, c in enumerate(row[:-1])] or [0.0]


def require_increasing(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the points if their first components increase.

    Raises:
        ValueError: if they do not.
    """
    for (a, _), (b, _) in pairwise(points):
        if not a < b:
            raise ValueError(f"points must increase in their first number, and {b:g} follows {a:g}")
    return tuple(points)


def interpolant_of_points(
    points: Sequence[Point], interpolation: Interpolation, extrapolation: Extrapolation, *, at_rest: bool = False
) -> "PPoly":
    """Return a smooth curve through points: a natural or a monotone cubic spline (Fritsch, Butland 1984).

    Beyond its ends the curve is constant or linear; `PPoly.antiderivative` integrates it exactly. A periodic curve
    covers one period; where periods join, it is as smooth as elsewhere.

    Args:
        points: pairs (t, u).
        interpolation: kind of the curve.
        extrapolation: extrapolation beyond its ends.
        at_rest: u' = 0 at both ends (a clamped spline), so that constant extrapolation causes no jump of u'.

    Raises:
        ValueError: if numbers are too large or too close.
    """
    from scipy.interpolate import PPoly  # imported here since few mechanisms need it

    x, y = np.array(points, float).T
    with np.errstate(all="ignore"), suppress(ValueError, np.linalg.LinAlgError):
        periodic = extrapolation == "periodic"
        c = _periodic_curve(x, y, interpolation) if periodic else _curve(tuple(points), interpolation, at_rest)
        if not periodic:
            rate = np.zeros(2) if extrapolation == "hold" else c(x[[0, -1]], 1)
            zero, width = np.zeros(2), x[-1] - x[0]
            ends = np.array([zero, zero, rate, [y[0] - width * rate[0], y[-1]]])  # one polynomial on either side
            c = PPoly(np.column_stack([ends[:, :1], c.c, ends[:, 1:]]), [x[0] - width, *x, x[-1] + width])
        if np.isfinite(c.antiderivative().c).all() and np.isfinite(c.x).all():
            return c
    raise ValueError("the numbers of points are too large or too close for a smooth curve")


@lru_cache(CACHE_SIZE)
def _curve(points: tuple[Point, ...], interpolation: Interpolation, at_rest: bool) -> "PPoly":
    """Return the curve between the first and the last point; cached, since a load and a motion may share it."""
    x, y = np.array(points, float).T
    return _curve_through(x, y, interpolation, at_rest=at_rest)


def _curve_through(x: np.ndarray, y: np.ndarray, interpolation: Interpolation, *, at_rest: bool) -> "PPoly":
    """Return the curve between the first and the last point."""
    from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

    if interpolation == "spline" or len(x) == 2:
        return CubicSpline(x, y, bc_type="clamped" if at_rest else "natural")
    rates = PchipInterpolator(x, y).derivative()(x)
    if at_rest:
        rates[[0, -1]] = 0.0
    return CubicHermiteSpline(x, y, rates)


def _periodic_curve(x: np.ndarray, y: np.ndarray, interpolation: Interpolation) -> "PPoly":
    """Return the curve of one period with increment y_n - y_0."""
    from scipy.interpolate import CubicSpline, PPoly

    width, increment, n = x[-1] - x[0], y[-1] - y[0], len(x) - 1
    if interpolation == "spline" and n > 1:
        mean_rate = increment / width
        deviation = y - mean_rate * (x - x[0])
        deviation[-1] = deviation[0]
        c = CubicSpline(x, deviation, bc_type="periodic").c
        c[2] += mean_rate
        c[3] += mean_rate * (x[:-1] - x[0])
        return PPoly(c, x)
    # the middle of three periods
    x3, y3 = (np.concatenate([z[:-1] - shift, z[:-1], z + shift]) for z, shift in ((x, width), (y, increment)))
    return PPoly(_curve_through(x3, y3, interpolation, at_rest=False).c[:, n : 2 * n], x)
