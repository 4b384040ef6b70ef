"""The end of a run in a terminal event, whose time moves: dt_e = -(e_y dy + e_p)/e'."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...finite_differences import numerical_derivative, numerical_jacobian
from ...integrate.events.event import Event, event_value
from ...integrate.events.level_crossing import TWO_PI, parse_level_crossing
from ...integrate.trajectory import LinearMap, Trajectory, TrajectoryPart
from ...mechanism.callbacks import function_name
from ...solution.signal_value import value as signal_value
from ...system import Array
from ...tolerances import INPUT_DIGITS
from .signal_jacobian import SignalJacobian

WIDTH = 1e-3  # of differences of event functions, which are the user's


@dataclass(frozen=True)
class EventTimeDerivative:
    """The last step, which ends in an event e(t, y, p) = 0, and how its size moves.

    Attributes:
        parts: of the step.
        by_t: de/dt.
        by_y: de/dy, (ny,).
        by_p: de/dp, (k,).
    """

    parts: list[TrajectoryPart]
    by_t: float
    by_y: Array
    by_p: Array

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array) -> tuple[Array, Array]:
        """Return the variations behind the step, whose size moves by dh, (m,)."""
        for part in self.parts:
            of_size = () if isinstance(part, LinearMap) else (dh,)
            dy, carry = part.forward(dy, carry, dp, *of_size)
        return dy, carry

    def by_size(self, like: Array, carry: Array) -> Array:
        """Variation of y behind the step for dh = 1, (ny, 1)."""
        zero = np.zeros((len(like), 1)), np.zeros((len(carry), 1)), np.zeros((len(self.by_p), 1))
        return self.forward(*zero, np.ones(1))[0]

    def move(self, dy: Array, carry: Array, dp: Array) -> Array:
        """Return dt_e, (m,)."""
        rise = self.by_t + (self.by_y @ self.by_size(dy, carry))[0]
        fixed = self.forward(dy, carry, dp, np.zeros(dy.shape[1]))[0]
        return -(self.by_y @ fixed + self.by_p @ dp) / rise

    def of_fixed_step(self, y: Array, carry: Array, late: float) -> tuple[Array, Array]:
        """Return the cotangents of y behind the step with its size held, and of p, of those with dt_e and of t_e."""
        by_size = self.by_size(y, carry)[:, 0]
        by_e = -(float(y[:, 0] @ by_size) + late) / (self.by_t + self.by_y @ by_size)
        return y + by_e * self.by_y[:, None], by_e * self.by_p


def ending(trace: Trajectory, event: Any) -> EventTimeDerivative | None:
    """The last step of a run that ended in an event; None for others.

    Args:
        trace: the run.
        event: `mbdae.Event`, or what it takes: a function, of which differences are taken, or a signal.

    Raises:
        InputError: where the event is missing, or none belongs; for a signal without a gradient.
        UnknownNameError: for a signal that does not exist.
    """
    if trace.sol.status != "event":
        if event is not None:
            raise InputError("the run did not end in an event: leave its function out")
        return None
    if event is None:
        raise InputError("the run ended in a terminal event, whose time moves: give its function or signal, event=")
    given, s = getattr(event, "function", event), trace.system
    last, t, y = len(trace.ts) - 1, float(trace.ts[-1]), trace.ys[-1]
    parts = list(trace.step_parts(last - 1))
    if isinstance(given, str):
        signal, level, _ = parse_level_crossing(given)
        row = (row_of := SignalJacobian(trace, [signal])).rows(last, t, y)[0]
        there = signal_value(s, row_of.signals[0], t, y) - level
        if row_of.signals[0].kind == "angle":
            there -= TWO_PI * round(there / TWO_PI)
        return _with_event_time(
            trace, EventTimeDerivative(parts, float(row[-1]), row[: s.ny], row[s.ny : -1]), given, there
        )
    if not callable(given):
        raise InputError(f"an event is a signal or a function of (t, q, v), got {given!r:.60}")

    def value(t: float, y: Array) -> float:
        return event_value(s, Event(given), t, y)

    by_t = numerical_derivative(lambda x: value(t + x, y), WIDTH)
    by_y = numerical_jacobian(lambda x: value(t, s.add(y, x)), s.ny, WIDTH)
    return _with_event_time(
        trace, EventTimeDerivative(parts, by_t, by_y, np.zeros(trace.sensitivity.k)), function_name(given), value(t, y)
    )


def _with_event_time(trace: Trajectory, end: EventTimeDerivative, name: str, value: float) -> EventTimeDerivative:
    """Refuse an event that has no time, or another one than the end of the run.

    Raises:
        InputError: names the event.
    """
    rise = end.by_t + (end.by_y @ end.by_size(np.zeros(trace.sensitivity.ny), np.zeros(trace.n_carry)))[0]
    t, size = float(trace.ts[-1]), float(np.abs(trace.ts[-1] - trace.ts[0]))
    if not rise:
        raise InputError(f"event {name!r} does not change where the run ends, at t = {t:.9g} s: its time does not move")
    if abs(value) > INPUT_DIGITS * size * abs(rise):
        raise InputError(f"event {name!r} is not that in which the run ended: it is {value:.3g} at t = {t:.9g} s")
    return end
