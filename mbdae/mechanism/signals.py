"""Functions of time: torques, references and motions that follow a clock, as data that stand in a file.

A plain number is a constant; a Python function of t becomes a `Function`. Inside, all are pieces of polynomials,
harmonics, or Python functions.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from math import inf, isfinite, nan, pi, sin
from typing import Annotated, Any, Literal, Union

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_serializer, model_validator

from .. import differences
from ..errors import InputError
from .callbacks import called, checked, function_name
from .pieces import Interpolation, Pieces, Point, curve, increasing
from .tables import Table

SPACING = 3e-3  # s, of differences


class _Signal(Table):
    """A function of time."""

    @abstractmethod
    def at(self, t: float, k: int = 0) -> float:
        """Return the k-th derivative with respect to time, k = 0, 1, 2."""

    def slope(self, t: float, k: int = 0) -> float:
        """Return the derivative of the k-th derivative: a difference of order six where it is not given."""
        if k < 2 and self.known(k + 1):
            return self.at(t, k + 1)
        return float(differences.slope(lambda x: self.at(t + x, k), SPACING))

    def known(self, k: int) -> bool:
        """Whether the k-th derivative is given, k = 0, 1, 2."""
        return True

    @property
    def breaks(self) -> Sequence[float]:
        """The times where it is not smooth."""
        return ()

    @property
    def knots(self) -> Sequence[float]:
        """The times where its pieces meet."""
        return ()

    def jump(self, t: float, sign: float) -> float:
        """Return the next time after t, in the direction of sign, where it is not smooth; sign * inf if none."""
        return sign * min((sign * s for s in self.breaks if sign * s > sign * t), default=inf)

    @abstractmethod
    def plain(self) -> dict[str, Any]:
        """What the core takes."""


class _Piecewise(_Signal):
    """A function of time that consists of polynomials."""

    @cached_property
    @abstractmethod
    def pieces(self) -> Pieces:
        """The polynomials."""

    def at(self, t: float, k: int = 0) -> float:
        return self.pieces.at(t, k)

    @property
    def breaks(self) -> Sequence[float]:
        return self.pieces.breaks

    @property
    def knots(self) -> Sequence[float]:
        return self.pieces.starts[1:]

    def plain(self) -> dict[str, Any]:
        return self.pieces.plain()


class Constant(_Piecewise):
    """A number; it stands as such in a file.

    Attributes:
        value: the number.
    """

    kind: Literal["constant"] = "constant"
    value: float

    def at(self, t: float, k: int = 0) -> float:  # noqa: D102
        return 0.0 if k else self.value

    @cached_property
    def pieces(self) -> Pieces:  # noqa: D102
        return Pieces([0.0], [[self.value]])

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

    def plain(self) -> dict[str, Any]:  # noqa: D102
        return {"kind": "harmonic", "a": [self.amplitude, self.omega, self.phase, self.offset]}


class Polynomial(_Piecewise):
    """sum_i coefficients_i t^i.

    Attributes:
        coefficients: c_0, c_1, ...; two of them are a constant speed c_1.
    """

    kind: Literal["polynomial"] = "polynomial"
    coefficients: tuple[float, ...] = Field(min_length=1)

    @cached_property
    def pieces(self) -> Pieces:  # noqa: D102
        return Pieces([0.0], [self.coefficients[::-1]])


class _Points(_Piecewise):
    """A function of time given by points (t, value), t increasing."""

    @field_validator("points", check_fields=False)
    @classmethod
    def _rise(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return increasing(points)

class TimeTable(_Points):
    """A smooth curve through points (t, value), t increasing; before and behind them the end values are held.

    Attributes:
        points: pairs (t, value) in s.
        interpolation: ``"spline"``, natural and cubic (two continuous derivatives), or ``"monotone"``, cubic without
            overshoot (one continuous derivative).
    """

    kind: Literal["table"] = "table"
    points: tuple[Point, ...] = Field(min_length=2)
    interpolation: Interpolation = "spline"

    @cached_property
    def pieces(self) -> Pieces:  # noqa: D102
        ends = (self.points[0][0], self.points[-1][0])
        return Pieces.of(curve(self.points, self.interpolation, held=True), ends)

    @model_validator(mode="after")
    def _is_smooth(self) -> "TimeTable":
        _ = self.pieces
        return self


class Steps(_Points):
    """Piecewise constant: from each time on its value; before the first time the first value.

    Attributes:
        points: pairs (t, value) in s, t increasing.
    """

    kind: Literal["steps"] = "steps"
    points: tuple[Point, ...] = Field(min_length=1)

    @cached_property
    def pieces(self) -> Pieces:  # noqa: D102
        times, values = zip(*self.points, strict=True)
        return Pieces(times, [[value] for value in values], times[1:])


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

    def known(self, k: int) -> bool:  # noqa: D102
        return (self.function, self.rate, self.acceleration)[k] is not None

    def plain(self) -> dict[str, Any]:  # noqa: D102
        return {"kind": "python", "call": self.at}


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
