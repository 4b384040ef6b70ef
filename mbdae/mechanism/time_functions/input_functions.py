"""Inputs as functions of time: set while a mechanism is simulated, and recorded."""

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple, Protocol
from weakref import WeakSet

from pydantic import Field, PrivateAttr, field_validator

from ...errors import InputError
from ..key_units import Unit
from .piecewise_polynomial import PiecewisePolynomial, require_increasing
from .time_function_base import BaseTimeFunction, PiecewiseFunction


class InputSetting(NamedTuple):
    """An input from time t in s on: value + rate (t' - t)."""

    t: float
    value: float
    rate: float = 0.0

    def at(self, t: float) -> float:
        """Return the input at time t in s."""
        return self.value + self.rate * (t - self.t)


class InputListener(Protocol):
    """A workspace with inputs as numbers."""

    def set_input(self, cell: "Input", number: int) -> None:
        """Take over the setting of an input, if it is bound to it."""


class Input(BaseTimeFunction):
    """A value that a `mbdae.Simulator` sets while it advances, or an output of an FMU; elsewhere constant.

    Attributes:
        name: of the input; equal names are one input.
        value: at the start.
        unit: for tables and displays.
        hold: between the times when it is set: ``"zero"``: constant, it jumps; ``"first"``: linear over an advance, or
            over a step of the FMU.
    """

    kind: Literal["input"] = "input"
    name: str = Field(min_length=1)
    value: Annotated[float, Unit("y")] = 0.0
    unit: str = ""
    hold: Literal["zero", "first"] = "zero"
    _setting: InputSetting | None = PrivateAttr(None)
    _number: int = PrivateAttr(-1)  # number in a mechanism in which it can be set
    _listeners: Any = PrivateAttr(())  # a set of weak references in such a mechanism

    @property
    def setting(self) -> InputSetting:
        """The last setting."""
        return self._setting or InputSetting(0.0, self.value)

    def cell(self, number: int) -> "Input":
        """Return a copy that can be set, of the copy of a mechanism that a simulator owns."""
        out = self.model_copy()
        out._setting, out._number, out._listeners = InputSetting(0.0, self.value), number, WeakSet()
        return out

    def listen(self, listener: InputListener) -> None:
        """Let a workspace take over all further settings."""
        if self._number >= 0:
            self._listeners.add(listener)

    def set(self, setting: InputSetting, notify: bool = True) -> None:
        """Set it, see `cell`; without notification, workspaces of the core keep their setting."""
        assert self._number >= 0
        self._setting = setting
        for listener in self._listeners if notify else ():
            listener.set_input(self, self._number)

    @property
    def number(self) -> int:
        """Its number among the inputs of a mechanism in which it can be set; -1 elsewhere."""
        return self._number

    def at(self, t: float, k: int = 0) -> float:
        now = self.setting
        return (now.at(t), now.rate)[k] if k < 2 else 0.0

    def core_data(self) -> dict[str, Any]:
        t, value, rate = self.setting
        return {"kind": "polynomials", "a": [rate, value], "b": [t], "degree": 1, "input": self._number}


class InputHistory(PiecewiseFunction):
    """The history of an input: linear pieces (t, value, rate) in s, t increasing; the first one also applies before.

    Attributes:
        name: of the input.
        pieces: each applies from its time on.
        hold: of the input.
    """

    kind: Literal["input_history"] = "input_history"
    name: str = ""
    hold: Literal["zero", "first"] = "zero"
    pieces: Annotated[tuple[tuple[float, float, float], ...], Unit("s", "y", "y/s")] = Field(min_length=1)

    @cached_property
    def polynomials(self) -> PiecewisePolynomial:
        times, values, rates = zip(*self.pieces, strict=True)
        return PiecewisePolynomial(times, zip(rates, values, strict=True), times[1:])

    @field_validator("pieces")
    @classmethod
    def _check_times(cls, pieces: tuple[tuple[float, float, float], ...]) -> tuple[tuple[float, float, float], ...]:
        require_increasing([(t, u) for t, u, _ in pieces])
        return pieces


def as_input(x: Input | InputHistory) -> Input:
    """Return an input, or the one that was recorded."""
    return x if isinstance(x, Input) else Input(name=x.name, value=x.pieces[0][1], hold=x.hold)


def map_inputs(value: Any, change: Callable[[Input | InputHistory], Any]) -> Any:
    """Return a force or driver, or a value of its keys, with its inputs replaced."""
    if isinstance(value, Input | InputHistory):
        return change(value)
    if isinstance(value, tuple):
        return tuple(map_inputs(x, change) for x in value)
    if not hasattr(type(value), "model_fields"):
        return value
    found = {name: getattr(value, name) for name in type(value).model_fields}
    update = {name: new for name, x in found.items() if (new := map_inputs(x, change)) is not x}
    if not update:
        return value
    out = value.model_copy(update=update)
    for name in vars(out).keys() - found.keys():  # cached properties, of the inputs before
        del vars(out)[name]
    return out


def inputs_in(parts: Iterable[Any]) -> dict[str, Input | InputHistory]:
    """Return the inputs in forces and drivers, and recorded ones, by name.

    Raises:
        InputError: for inputs of one name with different settings.
    """
    found: dict[str, Input | InputHistory] = {}

    def collect(x: Input | InputHistory) -> Input | InputHistory:
        if found.setdefault(x.name, x) != x and isinstance(x, Input):
            raise InputError(f"input {x.name!r} is given twice, with different settings")
        return x

    for part in parts:
        map_inputs(part, collect)
    return found
