"""Pieces of polynomials: what constants, polynomials, tables and steps are inside, and smooth curves through points."""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Point = tuple[float, float]
Interpolation = Literal["spline", "monotone"]


class Pieces:
    """u(t) = sum_p c_ip (t - t_i)^(d - p) from t_i on; the first piece counts before t_0, too.

    Args:
        starts: t_i, (n,), increasing.
        coefficients: c, (n, d + 1), highest power first.
        breaks: times where u is not smooth.
    """

    def __init__(
        self, starts: Iterable[float], coefficients: Iterable[Iterable[float]], breaks: Sequence[float] = ()
    ) -> None:
        rows = [[float(c) for c in row] for row in coefficients]
        self.starts, self.breaks = [float(t) for t in starts], breaks
        self._derivatives = [rows]
        for k in range(3):
            self._derivatives.append([_derivative(row) for row in self._derivatives[k]])

    @classmethod
    def of(cls, c: "PPoly", breaks: Sequence[float] = ()) -> "Pieces":
        """The pieces of a scipy curve."""
        return cls(c.x[:-1], c.c.T, breaks)

    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative, k = 0, 1, 2, 3."""
        i = max(0, bisect_right(self.starts, t) - 1)
        row, x = self._derivatives[k][i], t - self.starts[i]
        value = row[0]
        for j in range(1, len(row)):
            value = value * x + row[j]
        return value

    def plain(self) -> dict[str, Any]:
        """What the core takes."""
        rows = self._derivatives[0]
        return {"kind": "pieces", "a": [c for row in rows for c in row], "b": self.starts, "degree": len(rows[0]) - 1}


def _derivative(row: list[float]) -> list[float]:
    degree = len(row) - 1
    return [c * (degree - p) for p, c in enumerate(row[:-1])] or [0.0]


def increasing(points: Sequence[Point]) -> tuple[Point, ...]:
    """Check that the first numbers of points increase.

    Raises:
        ValueError: if they do not.
    """
    for (a, _), (b, _) in pairwise(points):
        if not a < b:
            raise ValueError(f"points must increase in their first number, and {b:g} follows {a:g}")
    return tuple(points)


def curve(points: Sequence[Point], interpolation: Interpolation, *, held: bool) -> "PPoly":
    """A smooth curve through points: a natural cubic spline, or a monotone one (Fritsch, Butland 1984).

    Beyond its ends it is held or goes on as a straight line; `PPoly.antiderivative` integrates it exactly.

    Raises:
        ValueError: where numbers are too large or too close for that.
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly  # few mechanisms have such a curve

    x, y = np.array(points, float).T
    with np.errstate(all="ignore"), suppress(ValueError, np.linalg.LinAlgError):
        spline = interpolation == "spline" or len(x) == 2
        inner = CubicSpline(x, y, bc_type="natural") if spline else PchipInterpolator(x, y)
        slope = np.zeros(2) if held else inner(x[[0, -1]], 1)
        zero, width = np.zeros(2), x[-1] - x[0]
        ends = np.array([zero, zero, slope, [y[0] - width * slope[0], y[-1]]])  # a piece on either side
        c = PPoly(np.column_stack([ends[:, :1], inner.c, ends[:, 1:]]), [x[0] - width, *x, x[-1] + width])
        if np.isfinite(c.antiderivative().c).all() and np.isfinite(c.x).all():
            return c
    raise ValueError("the numbers of points are too large or too close for a smooth curve")
