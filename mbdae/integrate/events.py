"""Events: level crossings of signals, and sign changes of functions of time and state.

Signals are located on steps of the method (`mbdae.integrate.signal_events`), functions on the dense output; terminal
events on a step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from ..errors import InputError
from ..mechanism.callbacks import function_name
from ..system import Array
from .signal_events import TANGENCY_TOLERANCE, SignalEvent, crossing_at_jump

if TYPE_CHECKING:
    from ..system import Step
    from .step_map import StepMap

SAMPLES = np.array([0.25, 0.5, 0.75, 1.0])  # of a step: a function may change sign several times within it
SAME = 1e-10  # s, or relative to t: an event this close to the start coincides with it, up to rounding errors
BESIDE = 1e-3  # of a step: distance on either side of an event for the derivative of its function
TRIALS = 8  # steps towards a terminal event, of which three or four are needed


@dataclass(frozen=True)
class Event:
    """A level crossing of a signal, or a zero of a function.

    A signal is a text: ``"v.crank"`` for its zeros, ``"q.slider = 0.3"``, ``"force.wrist pin > 100"`` where it rises
    above, ``"q.slider < 0.1"`` where it falls below; its names are those of `Solution.signals`, and effort of
    closures and drivers. A function is evaluated at four points of each step.

    Pairs of zeros between two evaluations are missed: choose ``max_step`` for fast changes.

    Attributes:
        function: a text, event(t, q, v) -> float for mechanisms, or event(t, y) for textbook problems.
        terminal: stop at the event.
        direction: +1 for zeros where the function rises, -1 where it falls, 0 for both.

    Raises:
        InputError: unless the event is a text or function and the direction is valid.
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


def as_events(events: Any) -> tuple[Event, ...]:
    """Return events as a tuple, given one or several: `Event`, signals, or functions with attributes as in scipy.

    Raises:
        InputError: for any other value.
    """
    one = isinstance(events, str) or not isinstance(events, Sequence)
    several = [] if events is None else [events] if one else list(events)
    out = []
    for e in several:
        if not isinstance(e, Event):
            if not callable(e) and not isinstance(e, str):
                raise InputError(f"an event is a signal, a function or mbdae.Event, got {type(e).__name__}")
            e = Event(e, bool(getattr(e, "terminal", False)), int(np.sign(getattr(e, "direction", 0))))
        out.append(e)
    return tuple(out)


class EventDetector:
    """Detects events from step to step and records them.

    A zero at the start of the run, to rounding, is an event there, in the direction in which it leaves zero, but does
    not end the run: a run may start on the surface where another one ended.

    Args:
        events: the events.
        evaluate: evaluates a function at (t, y).
        signals: the other events, bound to a workspace, by index.
    """

    def __init__(
        self,
        events: tuple[Event, ...],
        evaluate: Callable[[Event, float, Array], float],
        signals: dict[int, SignalEvent] | None = None,
    ) -> None:
        self.events, self.evaluate, self.signals = events, evaluate, signals or {}
        self.functions = {i: e for i, e in enumerate(events) if i not in self.signals}
        self.by_signal = not self.functions and all(s.signal.compiled for s in self.signals.values())  # in the core
        self.looked = self.stopped = False  # the last steps were checked; a terminal event was found
        self.found: list[list[tuple[float, Array]]] = [[] for _ in events]
        self._last: dict[int, float] = {}
        self._seen = np.nan  # time up to which steps were checked; nan after an impact

    def begin(self, t: float, y: Array) -> None:
        """Evaluate every event at the start."""
        self.start, self._seen = (t, y), t
        self._last = {i: self.evaluate(e, t, y) for i, e in self.functions.items()}
        for signal in self.signals.values():
            signal.begin(t, y)

    def restart_after_impact(self) -> None:
        """Begin the next step after an impact, at the time where the last one ended."""
        self._seen = np.nan

    @property
    def why_python(self) -> str:
        """Reason why the core cannot detect events."""
        named = [f"event {function_name(e.function)!r} is a function" for e in self.functions.values()]
        others = [self.events[i].function for i, s in self.signals.items() if not s.signal.compiled]
        modes = [] if named or others or self.by_signal else ["modes switch in Python"]
        return ", ".join([*modes, *named, *(f"the core does not have {text!r}" for text in others)])

    def core_data(self) -> list[Any]:
        """Return core data of the signals."""
        return [(s.signal.core_data(), s.level, s.direction, self.events[i].terminal) for i, s in self.signals.items()]

    def adopt_native(self, native: Any) -> None:
        """Take over events found by the core, and its current values."""
        if not self.events or not self.by_signal:
            return
        self.looked, self.stopped = True, native.stopped
        for i, t, y in native.found:
            self.found[i].append(self.start if t == self.start[0] else (t, y))
        for signal, node in zip(self.signals.values(), native.nodes, strict=True):
            signal.node = node
            self._seen = node[0]

    def step(self, step: "StepMap") -> tuple[float, Event] | None:
        """Check a step; return its first terminal event, preceded by the event's position in the step."""
        t, h = step.t, step.h
        touch = None if t == self._seen else TANGENCY_TOLERANCE if np.isnan(self._seen) else 0.0
        self._seen = step.t1
        hits: list[tuple[float, int, Array]] = []
        for i, event in self.functions.items():
            hits += [(theta, i, step.dense(theta)) for theta in self._zeros(i, event, step, touch)]
        for i, signal in self.signals.items():
            hits += [(theta, i, y) for theta, y in signal.zeros(step, touch)]
        same, stop = SAME * max(1.0, abs(t)), None
        for theta, i, y in sorted(hits, key=lambda hit: hit[:2]):
            if stop and (theta - stop[0]) * abs(h) > same:
                break
            begins = t == self.start[0] and theta * abs(h) <= same
            if theta == 0 and self.found[i] and abs(t - self.found[i][-1][0]) <= same:
                continue  # found before the impact
            self.found[i].append(self.start if begins else (t + theta * h, y))
            if self.events[i].terminal and not begins and stop is None:
                stop = theta, self.events[i]
        return stop

    def end(self, t: float, y: Array, sign: float) -> None:
        """End the run at (t, y): events found at or, by the dense output, beyond that time are moved to it."""
        limit = sign * t - SAME * max(1.0, abs(t))
        self.found = [[(t, y) if sign * when >= limit else (when, x) for when, x in hits] for hits in self.found]

    def _zeros(self, i: int, event: Event, step: "StepMap", touch: float | None) -> list[float]:
        zeros, theta0, g0 = [], 0.0, self._last[i]
        if touch is not None:
            passes, g0 = crossing_at_jump(g0, self.evaluate(event, step.t, step.y), event.direction, touch)
            zeros = [0.0] if passes else []
        known = {0.0: g0}

        def value(theta: float) -> float:
            if theta not in known:
                known[theta] = self.evaluate(event, step.t + theta * step.h, step.dense(theta))
            return known[theta]

        for theta1 in SAMPLES:
            g1 = value(theta1)
            sense = np.sign(g1) if g0 == 0 else np.sign(g1 - g0)
            if event.direction * sense >= 0:
                if g0 == 0 and theta0 == 0 and g1 != 0 and step.t == self.start[0]:
                    zeros.append(0.0)
                elif g0 * g1 < 0:
                    zeros.append(float(brentq(value, theta0, theta1, xtol=1e-15, rtol=1e-15)))
                elif g1 == 0 and g0 != 0:
                    zeros.append(float(theta1))
            theta0, g0 = theta1, g1
        self._last[i] = g0
        return zeros

    def land(
        self,
        event: Event,
        theta: float,
        t: float,
        h: float,
        at: Callable[[float], Array],
        take: Callable[[float], "Step"],
    ) -> tuple[float, "Step"]:
        """Return the share of a step from t to t + h at which the event is on the method's steps, and that step.

        The dense output, of one order less, provides the initial estimate and the derivative for secants; where they
        fail (an event function that jumps) the estimate is kept.

        Args:
            event: the event.
            theta: position of the event on the dense output.
            t: start of the step.
            h: its size.
            at: the dense output.
            take: repeats a share of the step.

        Raises:
            StepError: if a shorter step cannot be taken.
        """
        low, high = max(0.0, theta - BESIDE), min(1.0, theta + BESIDE)
        rise = self.evaluate(event, t + high * h, at(high)) - self.evaluate(event, t + low * h, at(low))
        derivative, step = rise / (high - low), take(theta)
        miss = self.evaluate(event, t + theta * h, step.state.y)
        for _ in range(TRIALS):
            nearer = theta - miss / derivative if derivative else theta
            if nearer == theta or not 0 < nearer <= 1:
                break
            trial = take(nearer)
            left = self.evaluate(event, t + nearer * h, trial.state.y)
            if not abs(left) < abs(miss):
                break
            derivative, theta, miss, step = (left - miss) / (nearer - theta), nearer, left, trial
        return theta, step
