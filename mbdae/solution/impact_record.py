"""Impacts of a run."""

from typing import NamedTuple


class Impact(NamedTuple):
    """An impact.

    Attributes:
        t: time in s.
        where: names of what was struck, stops and closures.
        impulse: of each of them in N s, or N m s where joints turn.
        rows: impulses of all rows, (ng,), those that loops pass on among them.
        loss: of energy in J.
    """

    t: float
    where: tuple[str, ...]
    impulse: tuple[float, ...]
    rows: tuple[float, ...]
    loss: float
