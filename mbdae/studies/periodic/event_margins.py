"""Margins of events at which the state jumps: how far a motion is from one event more, or one less.

An event with the signal f(t, y) at a level l is about to come where f touches l from its side, and about to go where
f' = 0 at it; a condition `when` decides about it where it is zero at the crossing.
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

WIDTH = THREE_DIGITS  # fraction of a step: difference quotients for the rate of a signal at an event


class ResetMargins:
    """The events of a mechanism, bound to a workspace.

    Args:
        system: a workspace.
    """

    def __init__(self, system: Index2System) -> None:
        self.system, self.mechanism = system, system.mechanism
        self.signals = {r.name: self._bound(r.signal) for r in self.mechanism.resets}
        self.conditions = {r.name: self._bound(r.when) for r in self.mechanism.resets if r.when}

    def _bound(self, text: str) -> SignalEvent:
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
        """Yield name, kind and value of the rates of signals at events, and of the conditions there."""
        for run in runs:
            for i, name in run.resets:
                yield name, "event rate", self._rate(run, i - 1, self.signals[name])
                if name in self.conditions:
                    yield name, "condition", self._condition(name, float(run.nodes[0][i - 1]), run.nodes[1][i - 1])

    def _rate(self, run: Solution, i: int, event: SignalEvent) -> float:
        """Return |f'| at node i, by one-sided quotients on the dense output."""
        t, y = float(run.nodes[0][i]), run.nodes[1][i]
        h = WIDTH * (t - float(run.nodes[0][i - 1]))
        times = t - h * np.array([1.0, 2.0])
        near, far = (
            value(self.system, event.signal, *at) for at in zip(times.tolist(), run.points(times), strict=True)
        )
        return abs(3 * value(self.system, event.signal, t, y) - 4 * near + far) / (2 * h)
