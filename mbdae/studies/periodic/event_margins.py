"""Margins of user-defined events: distances of a motion from one with an additional or a missing event.

A motion grazes the level l of a signal f(t, y) if f touches l between events (an additional event), or if f' = 0 at an
event (a missing one). A condition `when` adds or removes an event if it is zero at the crossing.
"""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from ...integrate.events.level_crossing import SignalEvent
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.hybrid.mode_point import ModePoint
from ...mechanism.hybrid.switch import Guard
from ...solution.signal_value import value
from ...solution.solution import Solution
from ...tolerances import THREE_DIGITS

WIDTH = THREE_DIGITS  # width of difference quotients for the rate of a signal at an event, as a fraction of a step


class ResetMargins:
    """Margins of the resets of a mechanism, evaluated in a workspace.

    Args:
        system: a workspace.
    """

    def __init__(self, system: Index2System) -> None:
        self.system, self.mechanism = system, system.mechanism
        self.signals = {r.name: self._signal_event(r.signal) for r in self.mechanism.resets}
        self.conditions = {r.name: self._signal_event(r.when) for r in self.mechanism.resets if r.when}

    def _signal_event(self, text: str) -> SignalEvent:
        return SignalEvent.from_text(self.system, self.mechanism, text, 0)

    @property
    def guards(self) -> list[Guard]:
        """Functions of a point that are positive before an event, one for each direction in which a signal crosses."""
        out = []
        for reset in self.mechanism.resets:
            event = self.signals[reset.name]
            for direction in (event.direction,) if event.direction else (1, -1):
                out.append(Guard("event", reset.name, -1, partial(self._distance, event, direction)))
        return out

    def _distance(self, event: SignalEvent, direction: int, point: ModePoint) -> float:
        return direction * (event.level - value(self.system, event.signal, point.t, point.y))

    def holds(self, name: str, t: float, y: np.ndarray) -> bool:
        """Return whether the condition of an event holds at a point; True without one."""
        return name not in self.conditions or self._condition(name, t, y) > 0

    def _condition(self, name: str, t: float, y: np.ndarray) -> float:
        """Return the distance of a condition from its level, positive where it holds."""
        event = self.conditions[name]
        return event.direction * (value(self.system, event.signal, t, y) - event.level)

    def at_events(self, runs: Sequence[Solution]) -> Iterator[tuple[str, str, float]]:
        """Yield name, kind and value of the margins at events: crossing speeds of signals, and conditions."""
        for run in runs:
            for i, name in run.resets:
                yield name, "crossing speed", self._crossing_speed(run, i - 1, self.signals[name])
                if name in self.conditions:
                    yield name, "condition", self._condition(name, float(run.nodes[0][i - 1]), run.nodes[1][i - 1])

    def _crossing_speed(self, run: Solution, i: int, event: SignalEvent) -> float:
        """Return |f'| at node i, by one-sided quotients on the dense output."""
        t, y = float(run.nodes[0][i]), run.nodes[1][i]
        h = WIDTH * (t - float(run.nodes[0][i - 1]))
        times = t - h * np.array([1.0, 2.0])
        first, second = (
            value(self.system, event.signal, *at) for at in zip(times.tolist(), run.points(times), strict=True)
        )
        return abs(3 * value(self.system, event.signal, t, y) - 4 * first + second) / (2 * h)
