"""User-defined events: level crossings of signals, and zeros of functions of time and state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ...callbacks import call_with_views, checked_value, function_name
from ...errors import InputError, StepError
from ...system import Array, System


@dataclass(frozen=True)
class Event:
    """A level crossing of a signal, or a zero of a function.

    The event of a signal is a string: ``"v.crank"`` for zeros of a signal, ``"q.slider = 0.3"`` for both directions,
    ``"force.wrist pin > 100"`` for rising and ``"q.slider < 0.1"`` for falling crossings; signals are named as in
    `Solution.signals`. A function is evaluated at four points of each step.

    Pairs of zeros between two evaluations are missed: limit ``max_step`` for fast changes.

    Attributes:
        function: a string, or a function event(t, q, v) -> float for mechanisms, event(t, y) for textbook problems.
        terminal: stop at the event.
        direction: +1 for zeros where the function rises, -1 where it falls, 0 for both.

    Raises:
        InputError: if the event is neither a string nor a function, or the direction is invalid.
    """

    function: Callable[..., float] | str
    terminal: bool = False
    direction: int = 0

    def __post_init__(self) -> None:
        if not callable(self.function) and not isinstance(self.function, str):
            raise InputError(
                f"an event is a signal or a function of (t, q, v), or of (t, y), got {self.function!r:.60}"
            )
        if self.direction not in (-1, 0, 1):
            raise InputError(f"an event's direction is -1, 0 or 1, got {self.direction!r}")


Events: TypeAlias = Event | str | Callable[..., float] | Sequence[Event | str | Callable[..., float]] | None


def as_events(events: Events) -> tuple[Event, ...]:
    """Return events as a tuple, given one or several: `Event`, signals, or functions with attributes as in scipy.

    Raises:
        InputError: for any other value.
    """
    if events is None:
        events = []
    elif isinstance(events, Event | str) or not isinstance(events, Sequence):
        events = [events]
    out = []
    for e in events:
        if not isinstance(e, Event):
            if not callable(e) and not isinstance(e, str):
                raise InputError(f"an event is a signal, a function or mbdae.Event, got {type(e).__name__}")
            e = Event(e, bool(getattr(e, "terminal", False)), int(np.sign(getattr(e, "direction", 0))))
        out.append(e)
    return tuple(out)


def event_value(system: System, event: Event, t: float, y: Array) -> float:
    """Evaluate an event function.

    Raises:
        StepError: if it fails or does not return a finite number; a boolean condition has no zero to locate.
    """
    assert callable(event.function)
    name = f"event {function_name(event.function)!r}"
    value = call_with_views(name, event.function, t, *system.split(y))
    if isinstance(value, bool | np.bool_):
        raise StepError("force", f"{name} returned {value}, expected a number that changes its sign, at t = {t:.17g}")
    return float(checked_value(value, (), t, name))
