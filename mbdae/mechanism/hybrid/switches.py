"""Switches of a mechanism, and the inactive rows of a mode."""

from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ...discovery import members
from ...errors import StepError
from ...system import Array
from .switch import Switch

if TYPE_CHECKING:
    from ..mechanism import Mechanism

Mode = tuple[int, ...]


def switches_of(mechanism: "Mechanism") -> tuple[Switch, ...]:
    """Return the numbered switches of a mechanism."""
    found = [s for kind in _kinds() for s in kind.of(mechanism)]
    for at, switch in enumerate(found):
        switch.at = at
    return tuple(found)


@cache
def _kinds() -> tuple[type[Switch], ...]:
    return tuple(dict.fromkeys(x for x in members(__package__, type) if issubclass(x, Switch) and x is not Switch))


def inactive_rows(switches: Sequence[Switch], mode: Mode) -> Array:
    """Return the indices of the inactive rows of a mode."""
    all_rows = {row for s in switches for row in s.rows}
    kept = {row for s, state in zip(switches, mode, strict=True) for row in s.active(state)}
    return np.array(sorted(all_rows - kept), int)


def describe_mode(switches: Sequence[Switch], mode: Mode) -> str:
    """Return a description of the mode: the states that are not idle."""
    said = [f"{s.name}: {s.states[state]}" for s, state in zip(switches, mode, strict=True) if state]
    return ", ".join(said) or "all open"


def with_names(reason: StepError, switches: Sequence[Switch], t: float, which: Iterable[int]) -> StepError:
    """Return an error with the names of the switches that take part, and the time."""
    names = " and ".join(repr(switches[i].name) for i in dict.fromkeys(which))
    return StepError(reason.status, f"{names}: {reason}, at t = {t:.17g}")
