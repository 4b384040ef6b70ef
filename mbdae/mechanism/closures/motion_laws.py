"""Motion laws y = f(x) between joints, as data in files: cams, indexing drives, eccentrics."""

from functools import cached_property
from math import factorial, floor, pi
from typing import Annotated, Literal, NamedTuple, Union

import numpy as np
from pydantic import Field, field_validator, model_validator

from ...data_types import CoreData
from ...system import Array
from ..checked_table import Table
from ..key_units import Unit
from ..tagged_union import TaggedByKind
from ..time_functions.piecewise_polynomial import PiecewisePolynomial, Point, require_increasing
from ..time_functions.time_functions import Harmonic

DEGREE = 7  # degree of splines: their seventh derivative jumps, which does not affect methods of order 6


class LawDerivatives(NamedTuple):
    """Value of a function and its first three derivatives."""

    y: float
    first: float
    second: float
    third: float


class LawTable(Table):
    """A smooth curve through points (x, y), x increasing: a spline of degree 7, with six continuous derivatives.

    Attributes:
        points: pairs (x, y) in rad or m of both joints. Beyond its ends the curve is linear. It overshoots where points
            are far apart: a dwell needs points as closely spaced as those of its flanks.
        periodic: whether the curve repeats after the last point; if the first and the last y differ, each period adds
            the difference (indexing drives).
    """

    kind: Literal["table"] = "table"
    points: Annotated[tuple[Point, ...], Unit("x", "y")] = Field(min_length=4)
    periodic: bool = False

    @field_validator("points")
    @classmethod
    def _require_increasing(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return require_increasing(points)

    @model_validator(mode="after")
    def _require_finite(self) -> "LawTable":
        if not np.isfinite(self.polynomials.core_data()["a"]).all():
            raise ValueError("the numbers of points are too large or too close for a smooth curve")
        return self

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        """The polynomials of one period, or of the whole curve."""
        x, y = np.array(self.points, float).T
        coefficients = spline(x, y[:, None], periodic=self.periodic)[:, :, 0]
        inner = PiecewisePolynomial(x[:-1], coefficients)
        if self.periodic:
            return inner
        lines = np.zeros((2, DEGREE + 1))  # before the first and after the last point
        lines[0, -2:] = coefficients[0, -2], coefficients[0, -1]
        lines[1, -2:] = inner.at(x[-1], 1), inner.at(x[-1])
        lines[0, -1] -= (x[-1] - x[0]) * lines[0, -2]
        return PiecewisePolynomial([2 * x[0] - x[-1], *x], [lines[0], *coefficients, lines[1]])

    def core_data(self) -> CoreData:
        """Return the core data."""
        return self.polynomials.core_data()


Law = Annotated[Union[LawTable, Harmonic], TaggedByKind()]  # noqa: UP007


def period_of(law: LawTable | Harmonic) -> tuple[float, float, float]:
    """Return start, length and increment of a period; length 0 if the law is not periodic."""
    if isinstance(law, LawTable):
        (x0, y0), (x1, y1) = law.points[0], law.points[-1]
        return (x0, x1 - x0, y1 - y0) if law.periodic else (0.0, 0.0, 0.0)
    return 0.0, 2 * pi / abs(law.omega) if law.omega else 0.0, 0.0


def law_derivatives(law: LawTable | Harmonic, x: float) -> LawDerivatives:
    """Return f and its derivatives at x."""
    start, length, increment = period_of(law)
    periods = floor((x - start) / length) if length else 0
    u = x - periods * length
    if isinstance(law, LawTable):
        f = law.polynomials.at
        return LawDerivatives(f(u) + periods * increment, f(u, 1), f(u, 2), f(u, 3))
    return LawDerivatives(law.at(u), law.at(u, 1), law.at(u, 2), -(law.omega**2) * law.at(u, 1))


def spline(x: Array, y: Array, *, periodic: bool) -> Array:
    """Return the polynomials between points x (n,) of a spline through y (n, m): (n - 1, 8, m), highest power first.

    In the periodic case the last y may differ from the first by the increment per period. Otherwise y'' = y''' = y''''
    = 0 at the ends.
    """
    mean_rate = (y[-1] - y[0]) / (x[-1] - x[0]) if periodic else np.zeros(y.shape[1])
    deviation = y - np.outer(x - x[0], mean_rate)
    deviation[-1] = deviation[0] if periodic else deviation[-1]
    natural = [(k, np.zeros(y.shape[1])) for k in (2, 3, 4)]
    from scipy.interpolate import make_interp_spline  # imported here since few mechanisms need it

    curve = make_interp_spline(x, deviation, k=DEGREE, bc_type="periodic" if periodic else (natural, natural))
    out = np.stack([curve(x[:-1], k) / factorial(k) for k in range(DEGREE, -1, -1)], axis=1)
    out[:, -2] += mean_rate
    out[:, -1] += np.outer(x[:-1] - x[0], mean_rate)
    return np.asarray(out)
