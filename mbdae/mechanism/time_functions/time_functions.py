"""Functions of time for torques, references and motions; a number is a `Constant`, a callable a `Function`."""

from collections.abc import Callable, Sequence
from functools import cached_property
from math import isfinite, nan, pi, sin
from typing import Annotated, Any, Literal, TypeVar, Union

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_serializer, model_validator

from ...callbacks import call_with_views, checked_value, function_name
from ...data_types import CoreData
from ...errors import InputError, is_number
from ..key_units import Unit
from ..tagged_union import TaggedByKind
from . import piecewise_polynomial as piecewise
from .input_functions import Input, InputHistory
from .piecewise_polynomial import Extrapolation, Interpolation, PiecewisePolynomial, Point
from .time_function_base import BaseTimeFunction, PiecewiseFunction

T = TypeVar("T")


class Constant(PiecewiseFunction):
    """A constant, written as a number in a file.

    Attributes:
        value: the number.
    """

    kind: Literal["constant"] = "constant"
    value: Annotated[float, Unit("y")]

    def at(self, t: float, k: int = 0) -> float:
        return 0.0 if k else self.value

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        return PiecewisePolynomial([0.0], [[self.value]])

    @model_serializer
    def _as_number(self) -> float:
        return self.value


class Harmonic(BaseTimeFunction):
    """offset + amplitude sin(omega t + phase).

    Attributes:
        amplitude: amplitude in the unit of the value.
        omega: angular frequency in rad/s; in a motion law, in rad per rad or m.
        phase: phase in rad.
        offset: mean value, in the unit of the value.
    """

    kind: Literal["harmonic"] = "harmonic"
    amplitude: Annotated[float, Unit("y")]
    omega: Annotated[float, Unit("rad/x")]
    phase: Annotated[float, Unit("rad")] = 0.0
    offset: Annotated[float, Unit("y")] = 0.0

    def at(self, t: float, k: int = 0) -> float:
        angle = self.omega * t + self.phase + k * pi / 2
        if not isfinite(angle):
            return nan
        value = self.amplitude * sin(angle)
        return value * (self.omega, self.omega * self.omega)[k - 1] if k else value + self.offset

    def core_data(self) -> CoreData:
        return {"kind": "harmonic", "a": [self.amplitude, self.omega, self.phase, self.offset]}


class Polynomial(PiecewiseFunction):
    """sum_i coefficients_i t^i.

    Attributes:
        coefficients: c_0, c_1, ...; two of them describe a constant speed c_1.
    """

    kind: Literal["polynomial"] = "polynomial"
    coefficients: Annotated[tuple[float, ...], Unit("y", powers_of="x")] = Field(min_length=1)

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        return PiecewisePolynomial([0.0], [self.coefficients[::-1]])


class _Points(PiecewiseFunction):
    """A function of time given by points (t, value), t increasing."""

    @field_validator("points", check_fields=False)
    @classmethod
    def _require_increasing(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return piecewise.require_increasing(points)


class TimeTable(_Points):
    """A smooth curve through points (t, value), t increasing.

    A periodic curve has the period t_n - t_1; where periods join, it is as smooth as elsewhere. Its last value equals
    its first value, except for a motion, which may increase by the difference in each period (a rotating crank).

    Attributes:
        points: pairs (t, value), t in s.
        interpolation: ``"spline"``, natural and cubic (two continuous derivatives), or ``"monotone"``, cubic without
            overshoot (one continuous derivative).
        beyond: extrapolation before the first time and after the last: ``"hold"`` the end values, ``"linear"``, or
            ``"periodic"``. When left out, loads and speeds keep their end values, and a run ends where the motion of a
            driver ends. A motion with ``"hold"`` comes to rest: u' = 0 at both ends, and u'' jumps.
    """

    kind: Literal["table"] = "table"
    points: Annotated[tuple[Point, ...], Unit("x", "y")] = Field(min_length=2)
    interpolation: Interpolation = "spline"
    beyond: Extrapolation | None = None

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        return self._interpolate(self.beyond or "hold", (self.points[0][0], self.points[-1][0]))

    @cached_property
    def motion(self) -> PiecewisePolynomial:
        """Polynomials of a motion: at rest beyond its ends with "hold", extrapolated linearly by default."""
        jumps = self.points if self.interpolation == "monotone" else (self.points[0], self.points[-1])  # jumps of u''
        return self._interpolate(self.beyond or "linear", [t for t, _ in jumps], at_rest=self.beyond == "hold")

    def _interpolate(
        self, extrapolation: Extrapolation, nonsmooth_times: Sequence[float], *, at_rest: bool = False
    ) -> PiecewisePolynomial:
        curve = piecewise.interpolant_of_points(self.points, self.interpolation, extrapolation, at_rest=at_rest)
        if extrapolation != "periodic":
            return PiecewisePolynomial.from_ppoly(curve, nonsmooth_times)
        period = self.points[-1][0] - self.points[0][0]
        return PiecewisePolynomial.from_ppoly(curve, (), period, self.increment_per_period)

    @property
    def increment_per_period(self) -> float:
        """Increment per period."""
        return self.points[-1][1] - self.points[0][1]

    @model_validator(mode="after")
    def _require_smooth(self) -> "TimeTable":
        _ = self.motion
        return self


class Steps(_Points):
    """Piecewise constant function: each value applies from its time on, the first value also before its time.

    Attributes:
        points: pairs (t, value), t in s, increasing.
    """

    kind: Literal["steps"] = "steps"
    points: Annotated[tuple[Point, ...], Unit("x", "y")] = Field(min_length=1)

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        times, values = zip(*self.points, strict=True)
        return PiecewisePolynomial(times, [[value] for value in values], times[1:])


class Function(BaseTimeFunction):
    """A Python function of time, with the derivatives required by its use.

    A saved solution records only its name; operations on a loaded solution that need its values fail.

    Args:
        function: t -> float.
        rate: first derivative of the function.
        acceleration: second derivative of the function.
        name: name in messages; by default that of the Python function.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
    """

    kind: Literal["function"] = "function"
    name: str = ""
    function: Callable[[float], float] | None = Field(default=None, exclude=True)
    rate: Callable[[float], float] | None = Field(default=None, exclude=True)
    acceleration: Callable[[float], float] | None = Field(default=None, exclude=True)

    def model_post_init(self, context: object) -> None:
        """Use the name of the function by default."""
        if not self.name:
            object.__setattr__(self, "name", function_name(self.function))

    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative.

        Raises:
            InputError: if it is not given.
            StepError: if the function fails, or does not return a finite number.
        """
        function = (self.function, self.rate, self.acceleration)[k]
        if function is None and self.function is None:
            raise InputError(f"{self.name!r} is a Python function and not in the file: load the mechanism with it")
        if function is None:
            raise InputError(f"the {('value', 'rate', 'acceleration')[k]} of {self.name!r} is needed (mbdae.Function)")
        what = f"function {self.name!r}"
        return float(checked_value(call_with_views(what, function, t), (), t, what))

    def has_derivative(self, k: int) -> bool:
        return (self.function, self.rate, self.acceleration)[k] is not None

    def core_data(self) -> CoreData:
        return {"kind": "python", "call": self.at}


TIME_FUNCTIONS: tuple[type[BaseTimeFunction], ...] = (
    Constant, Harmonic, Polynomial, TimeTable, Steps, Function, Input, InputHistory
)  # fmt: skip


def _coerce(value: object) -> Any:
    if is_number(value) or isinstance(value, float):  # the constant rejects inf and nan
        return Constant(value=float(value))
    if isinstance(value, str):
        raise ValueError("Input should be a number or a table")
    return Function(function=value) if callable(value) and not isinstance(value, BaseTimeFunction) else value


def _require_equal_end_values(u: T) -> T:
    if isinstance(u, TimeTable) and u.beyond == "periodic" and u.increment_per_period:
        ends = f"{u.points[0][1]:g} and {u.points[-1][1]:g}"
        raise ValueError(f"a periodic table of a load or speed ends with the value that it begins with, got {ends}")
    return u


Motion = Annotated[
    Annotated[
        Union[Constant, Harmonic, Polynomial, TimeTable, Steps, Function, Input, InputHistory],  # noqa: UP007
        TaggedByKind(),
    ],
    BeforeValidator(_coerce),
]
TimeFunction = Annotated[Motion, AfterValidator(_require_equal_end_values)]
