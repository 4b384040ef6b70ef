"""User-defined events: level crossings of signals, and sign changes of functions of time and state.

Events of signals are located on steps of the method (`level_crossing`), events of functions on the dense output, except
terminal events, which are located on steps of the method.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ...callbacks import function_name
from ...data_types import CoreData, JsonObject
from ...discovery import lazy_import
from ...errors import InputError, StepError
from ...system import Array, State, Step
from ...tolerances import AGREEMENT, ROUNDING, SOLUTION_ROUNDING
from .event import Event, event_value
from .level_crossing import SignalEvent, crossing_at_jump, departure_samples
from .source import EventSource, Occurrence

if TYPE_CHECKING:
    from ..run.run_state import RunState
    from ..run.step_map import StepMap

brentq = lazy_import("scipy.optimize", "brentq")
SAMPLES = np.array([0.25, 0.5, 0.75, 1.0])  # fractions of a step, in which a function may change sign several times
WIDTH = 1e-3  # fraction of a step: distance of the points on both sides of an event for the derivative of its function
MAX_TRIALS = 8  # trial steps to locate a terminal event; three or four are typical


class UserEvents(EventSource):
    """Detection and recording of user-defined events; terminal events end the run.

    A zero at the start of the run, to rounding, is an event, in the direction in which the function leaves zero, but
    does not end the run: a run may start on the event surface at which a previous run ended.

    Args:
        events: the events.
        evaluate: evaluates the function of an event at (t, y).
        signals: the events of signals, bound to a workspace, by index.
        modes: whether the run has modes, so that Python changes them.
    """

    def __init__(
        self,
        events: tuple[Event, ...],
        evaluate: Callable[[Event, float, Array], float],
        signals: dict[int, SignalEvent],
        modes: bool = False,
    ) -> None:
        self.events, self.evaluate, self.signals, self.is_needed = events, evaluate, signals, bool(events)
        self.functions = {i: e for i, e in enumerate(events) if i not in self.signals}
        compiled = all(s.signal.compiled for s in self.signals.values())
        self.by_signal = not self.functions and compiled and not modes  # detected in the core
        self.checked_in_core = self.stopped = False  # for the last steps; whether it found a terminal event
        self.recorded: list[list[tuple[float, Array]]] = [[] for _ in events]
        self._last_values: dict[int, float] = {}
        self._sides: dict[int, float] = {}  # signs of the functions in the last step
        self._checked_until = np.nan  # time up to which steps were checked; nan after an impact

    @classmethod
    def from_run(cls, run: "RunState") -> "UserEvents":
        system, events = run.system, run.options.events
        mechanism = run.mechanism_system and run.mechanism_system.mechanism
        modes = bool(mechanism and (mechanism.switches or mechanism.resets))
        return cls(events, lambda e, t, y: event_value(system, e, t, y), _signals(run), modes)

    def begin_interval(self, run: "RunState") -> None:
        """Evaluate every event at the start of the run."""
        if len(run.ts) > 1:
            return
        self.origin = t, y = run.t, run.state.y
        self._checked_until = t
        self._evaluate_functions(t, y)
        self._sides = dict.fromkeys(self.functions, 0.0)
        for signal in self.signals.values():
            signal.start_at(t, y)

    def _evaluate_functions(self, t: float, y: Array) -> None:
        self._last_values = {i: self.evaluate(e, t, y) for i, e in self.functions.items()}

    def discard_beyond_end(self, run: "RunState") -> None:
        """Discard events of a step that another source has truncated; events at its end remain."""
        if not run.sign * (self._checked_until - run.t) > 0:
            return
        t, y, limit = run.t, run.ys[-1], run.sign * run.t + AGREEMENT * max(1.0, abs(run.t))
        self._checked_until = t
        self.recorded = [[(when, x) for when, x in hits if run.sign * when <= limit] for hits in self.recorded]
        self._evaluate_functions(t, y)
        for signal in self.signals.values():
            signal.advance(t, y, signal.value(t, y))

    def after_discontinuity(self, run: "RunState", node: int, mode_changed: bool) -> None:
        """Check for crossings at the impact when the next step is checked."""
        if mode_changed:
            self._checked_until = np.nan

    @property
    def each_step(self) -> bool:  # type: ignore[override]
        """Whether every step must be checked in Python, since the core cannot detect the events."""
        return bool(self.events) and not self.by_signal

    def is_idle(self, run: "RunState", t1: float) -> bool:
        """Return whether there are no events."""
        return not self.events

    @property
    def why_python(self) -> str:
        """Reason why the core cannot detect events."""
        functions = [f"event {function_name(e.function)!r} is a function" for e in self.functions.values()]
        signals = [self.events[i].function for i, s in self.signals.items() if not s.signal.compiled]
        modes = [] if functions or signals or self.by_signal else ["modes switch in Python"]
        return ", ".join([*modes, *functions, *(f"the core does not have {text!r}" for text in signals)])

    def core_data(self) -> list[CoreData]:
        """Return core data of the signals."""
        return [
            {
                "signal": s.signal.core_data(),
                "level": s.level,
                "direction": s.direction,
                "unchanged_within": s.unchanged_within,
                "terminal": self.events[i].terminal,
            }
            for i, s in self.signals.items()
        ]

    def adopt_native(self, native: Any) -> None:
        """Record the events found by the core, and its current values of the signals."""
        if not self.events or not self.by_signal:
            return
        self.checked_in_core, self.stopped = True, native.stopped
        for i, t, y in native.located():
            self.recorded[i].append(self.origin if t == self.origin[0] else (t, y))
        for signal, node in zip(self.signals.values(), native.nodes, strict=True):
            signal.node = node
            self._checked_until = node[0]

    def first_event(self, step: "StepMap") -> Occurrence | None:
        """Record the events of a step, and return the first terminal one."""
        if self.checked_in_core:
            self.checked_in_core = False
            return Occurrence(step.t1) if self.stopped else None
        if not self.events or not (stop := self._terminal(step)):
            return None
        theta, event, simultaneous = stop
        out = self._occurrence(step, theta, event)
        for i in simultaneous:  # located on the dense output, which has one order less than the step
            self.recorded[i][-1] = out.t, out.end.state.y if out.end else step.y
        return out

    def handle_event(self, run: "RunState", ended: bool) -> bool:
        """End the run; move events at its end, or slightly after it by the dense output, to the end."""
        t, y, sign = run.t, run.ys[-1], run.sign
        limit = sign * t - AGREEMENT * max(1.0, abs(t))
        self.recorded = [[(t, y) if sign * when >= limit else (when, x) for when, x in hits] for hits in self.recorded]
        return True

    def names_at(self, t: float) -> list[str]:
        """Return the terminal events whose last occurrence is at a time: strings, or names of functions."""
        hits_of_events = zip(self.events, self.recorded, strict=True)
        last = [event.function for event, hits in hits_of_events if event.terminal and hits and hits[-1][0] == t]
        return [f if isinstance(f, str) else function_name(f) for f in last]

    def results(self, run: "RunState") -> dict[str, Any]:
        """Return the times (k,) and points (k, ...) of the zeros of each event."""
        out = []
        for hits in self.recorded:
            valid = [(t, y) for t, y in hits if (t - run.ts[-1]) * run.sign <= 0]
            points = np.array([y for _, y in valid]).reshape(-1, *run.ys[-1].shape)
            out.append((np.array([t for t, _ in valid], float), points))
        return {"events": out}

    def statistics(self, run: "RunState") -> JsonObject:
        """Return the back end that detects events, with the reason if it is Python."""
        where = run.stepper.backend if self.by_signal else f"python: {self.why_python}"
        return {"events": where} if self.events else {}

    def _terminal(self, step: "StepMap") -> tuple[float, Event, list[int]] | None:
        """Record the events of a step; return theta of the first terminal event, the event, and simultaneous events."""
        t, h, located = step.t, step.h, list[tuple[float, int]]()
        tolerance, stop = AGREEMENT * max(1.0, abs(t)), None
        for theta, i, y in sorted(self._zeros_in_step(step), key=lambda hit: hit[:2]):
            if stop and (theta - stop[0]) * abs(h) > tolerance:
                break
            at_start = t == self.origin[0] and theta * abs(h) <= tolerance
            if theta * abs(h) <= tolerance and self.recorded[i] and abs(t - self.recorded[i][-1][0]) <= tolerance:
                continue  # recorded before the impact
            self.recorded[i].append(self.origin if at_start else (t + theta * h, y))
            if self.events[i].terminal and not at_start and stop is None:
                stop = theta, self.events[i]
            located.append((theta, i))
        return (*stop, [i for theta, i in located if (stop[0] - theta) * abs(h) <= tolerance]) if stop else None

    def _zeros_in_step(self, step: "StepMap") -> list[tuple[float, int, Array]]:
        """Return the zeros in a step: theta, index of the event, point."""
        at_jump = SOLUTION_ROUNDING if np.isnan(self._checked_until) else 0.0
        tangency = None if step.t == self._checked_until else at_jump
        self._checked_until = step.t1
        hits: list[tuple[float, int, Array]] = []
        for i, event in self.functions.items():
            hits += [(theta, i, step.dense(theta)) for theta in self._zeros(i, event, step, tangency)]
        for i, signal in self.signals.items():
            hits += [(theta, i, y) for theta, y in signal.zeros(step, tangency)]
        return hits

    def _zeros(self, i: int, event: Event, step: "StepMap", tangency: float | None) -> list[float]:
        zeros, theta0, g0 = [], 0.0, self._last_values[i]
        if tangency is not None:
            g = self.evaluate(event, step.t, step.y)
            crosses, g0 = crossing_at_jump(g0, g, event.direction, tangency, self._sides[i])
            zeros = [0.0] if crosses else []
        if abs(g0) > SOLUTION_ROUNDING:
            self._sides[i] = np.sign(g0)
        cache = {0.0: g0}

        def value(theta: float) -> float:
            if theta not in cache:
                cache[theta] = self.evaluate(event, step.t + theta * step.h, step.dense(theta))
            return cache[theta]

        for theta1 in [*departure_samples(g0), *SAMPLES]:
            g1 = value(theta1)
            direction = np.sign(g1) if g0 == 0 else np.sign(g1 - g0)
            if event.direction * direction >= 0:
                if g0 == 0 and theta0 == 0 and g1 != 0 and step.t == self.origin[0]:
                    zeros.append(0.0)
                elif g0 * g1 < 0:
                    zeros.append(float(brentq(value, theta0, theta1, xtol=ROUNDING, rtol=ROUNDING)))
                elif g1 == 0 and g0 != 0:
                    zeros.append(float(theta1))
            theta0, g0 = theta1, g1
        self._last_values[i] = g0
        return zeros

    def _occurrence(self, step: "StepMap", theta: float, event: Event) -> Occurrence:
        """Return a terminal event at the end of a step of the method, which satisfies the closures like any other node.

        If no shorter step succeeds, the end is the point of the dense output, projected onto the closures. It is not
        projected for scipy's solvers, whose nodes do not satisfy the closures either, nor in a singularity crossing or
        near a singular configuration, where a step or a projection would rotate velocities.
        """
        run, t, empty = step.run, step.t + theta * step.h, np.empty(0)
        if step.start is None or (run.singularity_monitor and run.singularity_monitor.is_close(t, step.dense(theta))):
            return Occurrence(t, Step(State(step.dense(theta)), empty, empty), True)
        with suppress(StepError):
            if run.stepper.any_size:
                return self._on_step(step, theta, event)
        y = run.system.project_state(t, step.dense(theta)) if run.stepper.any_size else step.dense(theta)
        return Occurrence(t, Step(State(y), run.system.derivative(t, y)[1], empty))

    def _on_step(self, step: "StepMap", theta: float, event: Event) -> Occurrence:
        """Return an event at the end of a step of the method.

        The dense output, one order lower, provides the initial zero of a function and the derivative for the secant
        method; if this does not converge (an event function that jumps), the initial zero is used.

        Raises:
            StepError: if a shorter step cannot be taken.
        """
        t, h = step.t, step.h
        if theta == 0:
            return Occurrence(t)
        end = step.take(theta)
        if isinstance(event.function, str):
            return Occurrence(t + theta * h, end)
        low, high = max(0.0, theta - WIDTH), min(1.0, theta + WIDTH)
        rise = self.evaluate(event, t + high * h, step.dense(high)) - self.evaluate(event, t + low * h, step.dense(low))
        derivative = rise / (high - low)
        residual = self.evaluate(event, t + theta * h, end.state.y)
        for _ in range(MAX_TRIALS):
            next_theta = theta - residual / derivative if derivative else theta
            if next_theta == theta or not 0 < next_theta <= 1:
                break
            trial = step.take(next_theta)
            next_residual = self.evaluate(event, t + next_theta * h, trial.state.y)
            if not abs(next_residual) < abs(residual):
                break
            derivative = (next_residual - residual) / (next_theta - theta)
            theta, residual, end = next_theta, next_residual, trial
        return Occurrence(t + theta * h, end)


def _signals(run: "RunState") -> dict[int, SignalEvent]:
    """Bind all events of signals, by index, to one workspace.

    Raises:
        InputError: for an event of a signal of a textbook problem, or an invalid event.
    """
    texts = {i: (e.function, e.direction) for i, e in enumerate(run.options.events) if isinstance(e.function, str)}
    if not texts:
        return {}
    if not run.mechanism_system:
        text, _ = next(iter(texts.values()))
        raise InputError(f"events of a textbook problem are functions event(t, y), got {text!r}")
    workspace = run.mechanism_system.new_workspace()
    return {i: SignalEvent.from_text(workspace, workspace.mechanism, *text) for i, text in texts.items()}
