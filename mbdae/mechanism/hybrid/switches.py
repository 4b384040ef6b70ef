"""All switches of a mechanism, and the inactive rows of a mode."""

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
    """Return the switches of a mechanism, each with its index."""
    found = [s for kind in _kinds() for s in kind.from_mechanism(mechanism)]
    for i, switch in enumerate(found):
        switch.index = i
    return tuple(found)


@cache
def _kinds() -> tuple[type[Switch], ...]:
    found = members(f"{__package__}.kinds", type)
    return tuple(dict.fromkeys(x for x in found if issubclass(x, Switch) and x is not Switch))


def inactive_rows(switches: Sequence[Switch], mode: Mode) -> Array:
    """Return the indices of the inactive rows of a mode."""
    all_rows = {row for s in switches for row in s.rows}
    active = {row for s, state in zip(switches, mode, strict=True) for row in s.active_rows(state)}
    return np.array(sorted(all_rows - active), int)


def mode_by_position(switches: Sequence[Switch], mode: Mode, t: float, q: Array, v: Array) -> Mode:
    """Return a mode with the states at q of switches that depend on q alone; other states are unchanged."""
    return tuple(
        s.prescribed(t, q, v) if s.by_position else state for s, state in zip(switches, mode, strict=True)
    )


def unswitched_rows(switches: Sequence[Switch], ng: int) -> Array:
    """Return the indices of the rows without a switch."""
    return np.setdiff1d(np.arange(ng), [row for s in switches for row in s.rows])


def describe_mode(switches: Sequence[Switch], mode: Mode) -> str:
    """Return a description of a mode: the states that are not idle."""
    states = [f"{s.name}: {s.states[state]}" for s, state in zip(switches, mode, strict=True) if state]
    return ", ".join(states) or "all open"


def error_with_names(reason: StepError, switches: Sequence[Switch], t: float, indices: Iterable[int]) -> StepError:
    """Return an error with the names of the switches concerned, and the time."""
    names = " and ".join(repr(switches[i].name) for i in dict.fromkeys(indices))
    return StepError(reason.status, f"{names}: {reason}, at t = {t:.17g}")
