"""Motion laws y = f(x) between joints, as data of a file: cams, indexing drives, eccentrics."""

from functools import cached_property
from math import factorial, floor, pi
from typing import Annotated, Any, Literal, NamedTuple, Union

import numpy as np
from pydantic import Field, field_validator, model_validator

from ...system import Array
from ..checked_table import Table
from ..piecewise_polynomial import PiecewisePolynomial, Point, require_increasing
from ..time_functions import Harmonic

DEGREE = 7  # of splines: their seventh derivative jumps, which does not affect methods of order 6


class LawDerivatives(NamedTuple):
    """A function value and its first three derivatives at a point."""

    y: float
    first: float
    second: float
    third: float


class LawTable(Table):
    """A smooth curve through points (x, y), x increasing: a spline of degree 7, with six continuous derivatives.

    Attributes:
        points: pairs (x, y) in rad or m of both joints. Beyond its ends the curve continues as a straight line.
        periodic: the first and the last point coincide on a curve that repeats; where their y differ, each period adds
            the difference (indexing drives).
    """

    kind: Literal["table"] = "table"
    points: tuple[Point, ...] = Field(min_length=4)
    periodic: bool = False

    @field_validator("points")
    @classmethod
    def _rise(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return require_increasing(points)

    @model_validator(mode="after")
    def _is_smooth(self) -> "LawTable":
        if not np.isfinite(self.polynomials.core_data()["a"]).all():
            raise ValueError("the numbers of points are too large or too close for a smooth curve")
        return self

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        """The polynomials of one period, or of all."""
        x, y = np.array(self.points, float).T
        pieces = spline(x, y[:, None], periodic=self.periodic)[:, :, 0]
        if self.periodic:
            return PiecewisePolynomial(x[:-1], pieces)
        ends = np.zeros((2, DEGREE + 1))
        ends[0, -2:] = pieces[0, -2], pieces[0, -1]
        last = PiecewisePolynomial(x[:-1], pieces)
        ends[1, -2:] = last.at(x[-1], 1), last.at(x[-1])
        ends[0, -1] -= (x[-1] - x[0]) * ends[0, -2]
        return PiecewisePolynomial([2 * x[0] - x[-1], *x], [ends[0], *pieces, ends[1]])

    def core_data(self) -> dict[str, Any]:
        """Core data."""
        return self.polynomials.core_data()


Law = Annotated[Union[LawTable, Harmonic], Field(discriminator="kind")]  # noqa: UP007


def fold_of(law: LawTable | Harmonic) -> tuple[float, float, float]:
    """Start, length and rise of a period; length 0 without one."""
    if isinstance(law, LawTable):
        (x0, y0), (x1, y1) = law.points[0], law.points[-1]
        return (x0, x1 - x0, y1 - y0) if law.periodic else (0.0, 0.0, 0.0)
    return 0.0, 2 * pi / abs(law.omega) if law.omega else 0.0, 0.0


def law_derivatives(law: LawTable | Harmonic, x: float) -> LawDerivatives:
    """Return f and its derivatives at x."""
    start, length, rise = fold_of(law)
    turns = floor((x - start) / length) if length else 0
    u = x - turns * length
    if isinstance(law, LawTable):
        return LawDerivatives(law.polynomials.at(u) + turns * rise, *(law.polynomials.at(u, k) for k in (1, 2, 3)))
    return LawDerivatives(law.at(u), law.at(u, 1), law.at(u, 2), -(law.omega**2) * law.at(u, 1))


def spline(x: Array, y: Array, *, periodic: bool) -> Array:
    """Polynomials between points x (n,) of a spline through y (n, m): (n - 1, 8, m), highest power first.

    In the periodic case the last y may differ from the first by the rise per period. Otherwise y'' = y''' = y'''' = 0
    at the ends.
    """
    grown = (y[-1] - y[0]) / (x[-1] - x[0]) if periodic else np.zeros(y.shape[1])
    flat = y - np.outer(x - x[0], grown)
    flat[-1] = flat[0] if periodic else flat[-1]
    still = [(k, np.zeros(y.shape[1])) for k in (2, 3, 4)]
    from scipy.interpolate import make_interp_spline  # imported here since few mechanisms need it

    curve = make_interp_spline(x, flat, k=DEGREE, bc_type="periodic" if periodic else (still, still))
    out = np.stack([curve(x[:-1], k) / factorial(k) for k in range(DEGREE, -1, -1)], axis=1)
    out[:, -2] += grown
    out[:, -1] += np.outer(x[:-1] - x[0], grown)
    return np.asarray(out)
