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
    """A workspace that stores the values of inputs."""

    def set_input(self, source: "Input", index: int) -> None:
        """Copy the setting of an input, if the workspace is bound to it."""


class Input(BaseTimeFunction):
    """A value that a `mbdae.Simulator` or an output of an FMU sets during a simulation; otherwise constant.

    Attributes:
        name: name of the input; uses of one name share one input.
        value: value at the start.
        unit: unit in tables and displays.
        hold: value between two settings: ``"zero"``: constant, with jumps; ``"first"``: linear over a communication
            step of the simulator or the FMU.
    """

    kind: Literal["input"] = "input"
    name: str = Field(min_length=1)
    value: Annotated[float, Unit("y")] = 0.0
    unit: str = ""
    hold: Literal["zero", "first"] = "zero"
    _setting: InputSetting | None = PrivateAttr(None)
    _index: int = PrivateAttr(-1)  # index among the settable inputs of a mechanism
    _listeners: Any = PrivateAttr(())  # a set of weak references, if the input can be set

    @property
    def setting(self) -> InputSetting:
        """The last setting."""
        return self._setting or InputSetting(0.0, self.value)

    def settable_copy(self, index: int) -> "Input":
        """Return a copy that can be set, for the simulator's copy of a mechanism."""
        out = self.model_copy()
        out._setting, out._index, out._listeners = InputSetting(0.0, self.value), index, WeakSet()
        return out

    def listen(self, listener: InputListener) -> None:
        """Notify a workspace of all later settings."""
        if self._index >= 0:
            self._listeners.add(listener)

    def set(self, setting: InputSetting, notify: bool = True) -> None:
        """Set the input, see `settable_copy`; without notification, workspaces of the core keep their setting."""
        assert self._index >= 0
        self._setting = setting
        for listener in self._listeners if notify else ():
            listener.set_input(self, self._index)

    @property
    def index(self) -> int:
        """Index among the settable inputs of a mechanism; -1 if it cannot be set."""
        return self._index

    def at(self, t: float, k: int = 0) -> float:
        setting = self.setting
        return (setting.at(t), setting.rate)[k] if k < 2 else 0.0

    def core_data(self) -> dict[str, Any]:
        t, value, rate = self.setting
        return {"kind": "polynomials", "a": [rate, value], "b": [t], "degree": 1, "input": self._index}


class InputHistory(PiecewiseFunction):
    """The history of an input: linear pieces (t, value, rate), t increasing in s; the first also applies before its t.

    Attributes:
        name: name of the input.
        pieces: linear pieces, each valid from its time on.
        hold: hold between two settings, as for `Input`.
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
    """Return an input; from a recorded history, the input that was recorded."""
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
    for name in vars(out).keys() - found.keys():  # cached properties that depend on the old inputs
        del vars(out)[name]
    return out


def inputs_in(users: Iterable[Any]) -> dict[str, Input | InputHistory]:
    """Return the inputs, and recorded inputs, in forces and drivers, by name.

    Raises:
        InputError: for inputs of one name with different settings.
    """
    found: dict[str, Input | InputHistory] = {}

    def collect(x: Input | InputHistory) -> Input | InputHistory:
        if found.setdefault(x.name, x) != x and isinstance(x, Input):
            raise InputError(f"input {x.name!r} is given twice, with different settings")
        return x

    for user in users:
        map_inputs(user, collect)
    return found
