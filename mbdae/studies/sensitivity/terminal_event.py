"""Derivative of the time of a terminal event (implicit function theorem): dt_e = -(e_y dy + e_p dp)/e'."""

from dataclasses import dataclass

import numpy as np

from ...callbacks import function_name
from ...errors import InputError
from ...finite_differences import numerical_derivative, numerical_jacobian
from ...integrate.events.event import Event, event_value
from ...integrate.events.level_crossing import TWO_PI, parse_level_crossing
from ...integrate.trajectory.signal_jacobian import SignalJacobian
from ...integrate.trajectory.trajectory import LinearMap, Trajectory, TrajectoryPart
from ...solution.signal_value import value as signal_value
from ...system import Array
from ...tolerances import INPUT_DIGITS

WIDTH = 1e-3  # width of difference quotients of event functions, in rad, characteristic lengths, speeds and times


@dataclass(frozen=True)
class EventTimeDerivative:
    """The last step, which ends in an event e(t, y, p) = 0, and the partial derivatives of e.

    Attributes:
        step_parts: maps that make up the step, see `Trajectory.step_parts`.
        by_t: de/dt.
        by_y: de/dy, (ny,).
        by_p: de/dp, (k,).
    """

    step_parts: list[TrajectoryPart]
    by_t: float
    by_y: Array
    by_p: Array

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array) -> tuple[Array, Array]:
        """Return the tangents after the step, for tangents dh (m,) of its size."""
        for part in self.step_parts:
            size = () if isinstance(part, LinearMap) else (dh,)
            dy, carry = part.forward(dy, carry, dp, *size)
        return dy, carry

    def by_size(self, dy: Array, carry: Array) -> Array:
        """Return the derivative of y after the step with respect to the step size, (ny, 1); arguments give lengths."""
        zero = np.zeros((len(dy), 1)), np.zeros((len(carry), 1)), np.zeros((len(self.by_p), 1))
        return self.forward(*zero, np.ones(1))[0]

    def time_derivative(self, dy: Array, carry: Array, dp: Array) -> Array:
        """Return the tangent dt_e of the event time, (m,)."""
        total_rate = self.by_t + (self.by_y @ self.by_size(dy, carry))[0]
        fixed = self.forward(dy, carry, dp, np.zeros(dy.shape[1]))[0]
        return -(self.by_y @ fixed + self.by_p @ dp) / total_rate

    def of_fixed_step(self, y: Array, carry: Array, bar_t: Array) -> tuple[Array, Array]:
        """Return cotangents of y after the step of fixed size, and of p, from those of y and of t_e; (..., costs)."""
        by_size = self.by_size(y, carry)[:, 0]
        by_e = -(by_size @ y + bar_t) / (self.by_t + self.by_y @ by_size)
        return y + np.outer(self.by_y, by_e), np.outer(self.by_p, by_e)


def terminal_event(trajectory: Trajectory, event: object) -> EventTimeDerivative | None:
    """Return the last step of a run that ended in an event; None for any other run.

    Args:
        trajectory: the run.
        event: `mbdae.Event`, or its function, which is differentiated numerically, or signal.

    Raises:
        InputError: for a missing or superfluous event, or a signal without a gradient.
        UnknownNameError: for a signal that does not exist.
    """
    if trajectory.sol.status != "event":
        if event is not None:
            raise InputError("the run did not end in an event: omit event=")
        return None
    if event is None:
        raise InputError(
            "the run ended in a terminal event, whose time depends on parameters: give its function or signal, event="
        )
    condition, s = getattr(event, "function", event), trajectory.system
    last, t, y = len(trajectory.ts) - 1, float(trajectory.ts[-1]), trajectory.ys[-1]
    step_parts = list(trajectory.step_parts(last - 1))
    if isinstance(condition, str):
        signal, level, _ = parse_level_crossing(condition)
        row = (row_of := SignalJacobian(trajectory, [signal])).rows(last, t, y)[0]
        residual = signal_value(s, row_of.signals[0], t, y) - level
        if row_of.signals[0].kind == "angle":
            residual -= TWO_PI * round(residual / TWO_PI)
        end = EventTimeDerivative(step_parts, float(row[-1]), row[: s.ny], row[s.ny : -1])
        return _require_transversal(trajectory, end, condition, residual)
    if not callable(condition):
        raise InputError(f"an event is a signal or a function of (t, q, v), got {condition!r:.60}")

    def value(t: float, y: Array) -> float:
        return event_value(s, Event(condition), t, y)

    widths = WIDTH * np.append(s.mechanism.motion_scales, np.ones(s.ns + 1))
    by_t = numerical_derivative(lambda x: value(t + x, y), WIDTH / s.mechanism.characteristic_rate)
    by_y = numerical_jacobian(lambda x: value(t, s.add(y, x)), s.ny, widths)
    end = EventTimeDerivative(step_parts, by_t, by_y, np.zeros(trajectory.sensitivity.k))
    return _require_transversal(trajectory, end, function_name(condition), value(t, y))


def _require_transversal(
    trajectory: Trajectory, end: EventTimeDerivative, name: str, value: float
) -> EventTimeDerivative:
    """Return an event derivative after checks: e' != 0, and e = 0 at the end of the run.

    Raises:
        InputError: with the name of the event.
    """
    rate = end.by_size(np.zeros(trajectory.sensitivity.ny), np.zeros(trajectory.n_carry))
    total_rate = end.by_t + (end.by_y @ rate)[0]
    t, size = float(trajectory.ts[-1]), float(np.abs(trajectory.ts[-1] - trajectory.ts[0]))
    if not total_rate:
        raise InputError(
            f"event {name!r} has zero rate at the end of the run, t = {t:.9g} s: its time has no derivative"
        )
    if abs(value) > INPUT_DIGITS * size * abs(total_rate):
        raise InputError(f"event {name!r} is not the one in which the run ended: it is {value:.3g} at t = {t:.9g} s")
    return end
