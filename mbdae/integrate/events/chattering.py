"""Chattering: modes that switch without end."""

from collections import deque
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ...mechanism.hybrid.switches import describe_mode
from ...tolerances import COINCIDENT
from .source import EventError

if TYPE_CHECKING:
    from ...mechanism.hybrid.switch import Switch
    from ...mechanism.hybrid.switches import Mode

MAX_TRANSITIONS = 100  # times the number of switches plus one: more transitions within a rest time are chattering


class Chattering:
    """Check for chattering, by the times of the mode transitions of a run.

    Args:
        switches: the switches of the mechanism.
    """

    def __init__(self, switches: "Sequence[Switch]") -> None:
        self.switches, self.rest = switches, min((s.rest for s in switches if s.rest), default=0.0)
        self.times = deque[float](maxlen=1 + MAX_TRANSITIONS * (1 + len(switches)))  # times of the last transitions

    def check(self, node: int, t: float, fired: Iterable[str], mode: "Mode") -> None:
        """Add a transition at a node.

        Args:
            node: the last node of the mode.
            t: time in s.
            fired: the switches whose guards are zero there.
            mode: the mode.

        Raises:
            EventError: in case of chattering.
        """
        (times := self.times).append(t)
        if len(times) == times.maxlen and abs(t - times[0]) <= max(self.rest, COINCIDENT * abs(t)):
            names = " and ".join(map(repr, fired))
            where = f"at t = {t:.17g} ({describe_mode(self.switches, mode)})"
            raise EventError("switching", f"{names}: chattering, modes switch without end {where}", node)
