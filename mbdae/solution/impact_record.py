"""Impacts of a run."""

from typing import NamedTuple


class Impact(NamedTuple):
    """An impact.

    Attributes:
        t: time in s.
        where: names of the stops and closures that take part.
        impulse: of each of them in N s, or N m s for rotations.
        rows: impulses of all rows, (ng,), including those transmitted by loops.
        loss: of energy in J.
    """

    t: float
    where: tuple[str, ...]
    impulse: tuple[float, ...]
    rows: tuple[float, ...]
    loss: float
