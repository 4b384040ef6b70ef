"""Functions of time: torques, references and motions that follow a clock, as data that stand in a file.

A plain number is a constant; a Python function of t becomes a `Function`.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import pairwise
from math import factorial, inf, isfinite, nan, pi, sin
from typing import Annotated, Any, Literal, Union

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_serializer, model_validator
from scipy.interpolate import CubicSpline, PchipInterpolator, PPoly

from ..errors import InputError
from .callbacks import called, checked, function_name
from .tables import Table

Point = tuple[float, float]
Interpolation = Literal["spline", "monotone"]


class _Signal(Table):
    """A function of time."""

    @abstractmethod
    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative with respect to time, k = 0, 1, 2."""

    def jump(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, where it is not smooth; sign * inf if none."""
        return sign * inf


class Constant(_Signal):
    """A number; it stands as such in a file.

    Attributes:
        value: the number.
    """

    kind: Literal["constant"] = "constant"
    value: float

    def at(self, t: float, k: int = 0) -> float:  # noqa: D102
        return 0.0 if k else self.value

    @model_serializer
    def _plain(self) -> float:
        return self.value


class Harmonic(_Signal):
    """offset + amplitude sin(omega t + phase).

    Attributes:
        amplitude: in the unit of the value.
        omega: rad/s.
        phase: rad.
        offset: in the unit of the value.
    """

    kind: Literal["harmonic"] = "harmonic"
    amplitude: float
    omega: float
    phase: float = 0.0
    offset: float = 0.0

    def at(self, t: float, k: int = 0) -> float:  # noqa: D102
        angle = self.omega * t + self.phase + k * pi / 2
        if not isfinite(angle):
            return nan
        value = self.amplitude * sin(angle)
        return value * (self.omega, self.omega * self.omega)[k - 1] if k else value + self.offset


class Polynomial(_Signal):
    """sum_i coefficients_i t^i.

    Attributes:
        coefficients: c_0, c_1, ...; two of them are a constant speed c_1.
    """

    kind: Literal["polynomial"] = "polynomial"
    coefficients: tuple[float, ...] = Field(min_length=1)

    def at(self, t: float, k: int = 0) -> float:  # noqa: D102
        value = 0.0
        for i in range(len(self.coefficients) - 1, k - 1, -1):
            value = value * t + self.coefficients[i] * factorial(i) / factorial(i - k)
        return value


class TimeTable(_Signal):
    """A smooth curve through points (t, value), t increasing; before and behind them the end values are held.

    Attributes:
        points: pairs (t, value) in s.
        interpolation: ``"spline"``, natural and cubic (two continuous derivatives), or ``"monotone"``, cubic without
            overshoot (one continuous derivative).
    """

    kind: Literal["table"] = "table"
    points: tuple[Point, ...] = Field(min_length=2)
    interpolation: Interpolation = "spline"

    @field_validator("points")
    @classmethod
    def _rise(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return increasing(points)

    @cached_property
    def _curves(self) -> list[PPoly]:
        c = curve(self.points, self.interpolation, held=True)
        return [c, c.derivative(1), c.derivative(2)]

    @model_validator(mode="after")
    def _is_smooth(self) -> "TimeTable":
        _ = self._curves
        return self

    def at(self, t: float, k: int = 0) -> float:  # noqa: D102
        return float(self._curves[k](t))

    def jump(self, t: float, sign: float) -> float:  # noqa: D102
        return after([self.points[0][0], self.points[-1][0]], t, sign)


class Steps(_Signal):
    """Piecewise constant: from each time on its value; before the first time the first value.

    Attributes:
        points: pairs (t, value) in s, t increasing.
    """

    kind: Literal["steps"] = "steps"
    points: tuple[Point, ...] = Field(min_length=1)

    @field_validator("points")
    @classmethod
    def _rise(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return increasing(points)

    def at(self, t: float, k: int = 0) -> float:  # noqa: D102
        i = int(np.searchsorted([p[0] for p in self.points], t, side="right"))
        return 0.0 if k else self.points[max(0, i - 1)][1]

    def jump(self, t: float, sign: float) -> float:  # noqa: D102
        return after([p[0] for p in self.points[1:]], t, sign)


class Function(_Signal):
    """A Python function of time, with its derivatives where they are needed.

    A saved solution records it by name; what needs its values then refuses.

    Args:
        function: t -> float.
        rate: its first derivative.
        acceleration: its second derivative.
        name: the function's own when left out.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
    """

    kind: Literal["function"] = "function"
    name: str = ""
    function: Callable[[float], float] | None = Field(default=None, exclude=True)
    rate: Callable[[float], float] | None = Field(default=None, exclude=True)
    acceleration: Callable[[float], float] | None = Field(default=None, exclude=True)

    def model_post_init(self, context: Any) -> None:
        """Give the function's own name."""
        if not self.name:
            object.__setattr__(self, "name", function_name(self.function))

    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative.

        Raises:
            InputError: if it was not given.
            StepError: if it fails, or does not return a finite number.
        """
        function = (self.function, self.rate, self.acceleration)[k]
        if function is None and self.function is None:
            raise InputError(f"{self.name!r} is a Python function and not in the file: load the mechanism with it")
        if function is None:
            raise InputError(f"the {('value', 'rate', 'acceleration')[k]} of {self.name!r} is needed (mbdae.Function)")
        what = f"function {self.name!r}"
        return float(checked(called(what, function, t), (), t, what))


SIGNALS: tuple[type[_Signal], ...] = (Constant, Harmonic, Polynomial, TimeTable, Steps, Function)


def _coerce(value: Any) -> Any:
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return Constant(value=float(value))
    return Function(function=value) if callable(value) and not isinstance(value, _Signal) else value


Signal = Annotated[
    Annotated[
        Union[Constant, Harmonic, Polynomial, TimeTable, Steps, Function],  # noqa: UP007
        Field(discriminator="kind"),
    ],
    BeforeValidator(_coerce),
]


def increasing(points: Sequence[Point]) -> tuple[Point, ...]:
    """Check that the first numbers of points increase.

    Raises:
        ValueError: if they do not.
    """
    for (a, _), (b, _) in pairwise(points):
        if not a < b:
            raise ValueError(f"points must increase in their first number, and {b:g} follows {a:g}")
    return tuple(points)


def curve(points: Sequence[Point], interpolation: Interpolation, *, held: bool) -> PPoly:
    """A smooth curve through points: a natural cubic spline, or a monotone one (Fritsch, Butland 1984).

    Beyond its ends it is held or goes on as a straight line; `PPoly.antiderivative` integrates it exactly.

    Raises:
        ValueError: where numbers are too large or too close for that.
    """
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


def after(times: Sequence[float], t: float, sign: float) -> float:
    """The first of some times after t in the direction of sign; sign * inf if there is none."""
    return sign * min((sign * s for s in times if sign * s > sign * t), default=inf)
