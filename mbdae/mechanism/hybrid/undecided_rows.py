"""Mode selection for unilateral rows with lam = 0 and zero acceleration, by their multipliers after a short step.

For a closed contact with lam = 0 and zero acceleration, the first nonzero derivative of lam decides, with all undecided
rows active: it stays active if lam^(k) > 0 and separates if lam^(k) < 0 (lexicographic complementarity). Derivatives
are not formed: all undecided rows are active over a short step, after which the signs of their multipliers decide.
Rows are released one at a time, the one with the largest tension first.

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
    from .switch import CandidateRow
    from .switches import Mode

STEP_FRACTIONS = 10.0 ** np.arange(-9, -2)  # fractions of the time to the next jump, which steps must not cross
SIGNIFICANT = 1e3  # smallest significant multiplier, in rounding errors of multipliers

MultipliersAfterStep = Callable[["Mode", float], tuple[Array, float]]
"""Function of a mode and a step, as a fraction of the time to the next jump: lam (ng,) and its rounding error."""


def rows_that_stay_active(
    mode: "Mode", undecided: dict[int, "CandidateRow"], multipliers_after_step: MultipliersAfterStep
) -> set[int]:
    """Return the undecided switches that remain active.

    Args:
        mode: states of all switches, with undecided switches open.
        undecided: rows of the undecided switches, by their indices.
        multipliers_after_step: the multipliers of a mode after a short step.
    """
    remaining = dict(undecided)
    while remaining:
        multipliers = _multipliers(mode, remaining, multipliers_after_step)
        worst = min(multipliers, key=lambda i: multipliers[i])
        if multipliers[worst] >= 0:
            return {i for i, lam in multipliers.items() if lam > 0}
        del remaining[worst]
    return set()


def _multipliers(
    mode: "Mode", active: dict[int, "CandidateRow"], multipliers_after_step: MultipliersAfterStep
) -> dict[int, float]:
    """Return the multipliers of switches if all of them are active, positive under compression; 0 if insignificant."""
    trial, multipliers = list(mode), dict.fromkeys(active, 0.0)
    for i in active:
        trial[i] = ACTIVE_STATE
    with suppress(StepError):
        for fraction in STEP_FRACTIONS:
            lam, rounding = multipliers_after_step(tuple(trial), float(fraction))
            signed = {i: float(lam[c.row]) * (1.0 if np.isfinite(c.lower) else -1.0) for i, c in active.items()}
            multipliers = {i: x if abs(x) > SIGNIFICANT * rounding else 0.0 for i, x in signed.items()}
            if all(multipliers.values()):
                break
    return multipliers
