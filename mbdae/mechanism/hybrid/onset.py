"""Unilateral rows that neither press nor separate at a point: decided by the loads a short step later.

Where a row touches with lam = 0 and without acceleration, the first nonzero derivative of lam decides, with all
undecided rows active: lam^(k) > 0 keeps it active, lam^(k) < 0 separates it (lexicographic complementarity). The
derivatives are not formed: all undecided rows are active over a step of length d, and the signs of their loads after
it are used. The row with the largest tension is released first, and so on, one at a time.

Source: A. J. van der Schaft, J. M. Schumacher, Math. Control Signals Systems 9 (1996), for mode selection by the first
    nonzero derivative.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...system import Array
from .switch import ACTIVE_STATE

if TYPE_CHECKING:
    from .switch import LoadCandidate
    from .switches import Mode

SHARES = 10.0 ** np.arange(-9, -2)  # of the time to the next jump, which no step may cross
CLEAR = 1e3  # times the rounding of multipliers: smallest significant load

Later = Callable[["Mode", float], tuple[Array, float]]  # see `pressing`


def pressing(mode: "Mode", undecided: dict[int, "LoadCandidate"], step: Later) -> set[int]:
    """Return the undecided switches that remain active.

    Args:
        mode: state of the other switches, with these open.
        undecided: their rows, by indices of the switches.
        step: returns lam (ng,) after a step in a mode, and its rounding error, given the mode and the size of the step
            as a share of the time to the next jump.
    """
    left = dict(undecided)
    while left:
        loads = _loads(mode, left, step)
        worst = min(loads, key=lambda i: loads[i])
        if loads[worst] >= 0:
            return {i for i, load in loads.items() if load > 0}
        del left[worst]
    return set()


def _loads(mode: "Mode", held: dict[int, "LoadCandidate"], step: Later) -> dict[int, float]:
    """Return the loads of the given active switches, positive under compression; 0 if there is none."""
    trial, loads = list(mode), dict.fromkeys(held, 0.0)
    for i in held:
        trial[i] = ACTIVE_STATE
    with suppress(StepError):
        for share in SHARES:
            lam, rounding = step(tuple(trial), float(share))
            signed = {i: float(lam[c.row]) * (1.0 if np.isfinite(c.lower) else -1.0) for i, c in held.items()}
            loads = {i: x if abs(x) > CLEAR * rounding else 0.0 for i, x in signed.items()}
            if all(loads.values()):
                break
    return loads
