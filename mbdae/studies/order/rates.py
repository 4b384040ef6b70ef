"""Observed order from errors versus step sizes: selection of refinements, fitted slope, and comparison with a claim.

The slope is a least-squares fit over the four finest refinements of the step whose rates agree, or else the four
finest; a refinement is a halving or a smaller ratio. With error = C h^p (1 + O(h)) the rate between two steps is
p + O(h): each halving halves its remaining change. Rates that change more than that (long steps, or cancelling errors
of several orders) are not the order. If they rise above a claim, the slope is that of the last two refinements; if they
have fallen below it, the result is undecided. They refute it only if the last rate plus the total change over the four
is still below it, and if errors are small compared with the motion.
"""

from collections.abc import Sequence

import numpy as np

from ...system import Array
from .result import ObservedOrder

REFINEMENTS, LAST = 4, 2  # refinements to which an order is fitted; the last ones, if rates rise above the claim
MARGIN = 0.2  # allowed deficit of an observed order
FLOOR_RATIO = 100.0  # multiple of rounding and reference uncertainty above which errors count
MAX_ERROR_FRACTION = 0.1  # fraction of the change of a quantity above which other terms than the leading one matter
CONSTANT_SPREAD = 0.1  # spread of the last rates below which finer steps are not needed


def fit(
    quantity: str,
    claimed: int,
    ns: list[int],
    errors: list[float],
    floors: list[float],
    uncertainty: float,
    change: float,
    max_solves: int,
    failure: str = "",
) -> ObservedOrder:
    """Fit a slope to errors versus numbers of steps, coarse ones first, and compare it with the claim.

    Errors count above their floors; errors above a tenth of the change of the quantity cannot refute a claim.
    Reasons name the uncertainty of the reference, the largest number of solves, or the failure of the last run.
    """
    end = asymptotic(ns, errors[: count_above_floors(errors, floors)])
    record = (tuple(ns), tuple(float(e) for e in errors), tuple(float(f) for f in floors))
    if end < REFINEMENTS + 1:
        counted = f"only {end - 1} refinement{'s' * (end != 2)}" if end else "no error"
        if end == len(ns):
            none = f"no run was completed, {failure}" if failure else "no run was completed"
            reason = f"{counted} within {max_solves} solves" if end else none
        elif 2 * FLOOR_RATIO * uncertainty > floors[end]:
            reason = f"{counted} above {FLOOR_RATIO:g} times the uncertainty of the reference, {uncertainty:.1e}"
        else:
            reason = f"{counted} above {FLOOR_RATIO:g} times rounding"
        return ObservedOrder(quantity, claimed, None, f"cannot be judged: {reason}", *record)
    first = end - 1 - REFINEMENTS
    x, y = np.log2(ns[first:end]), -np.log2(errors[first:end])
    last, verdict = assess(x, y, claimed - MARGIN)
    if not verdict:
        changing = ", ".join(f"{rate:.2f}" for rate in np.diff(y) / np.diff(x))
        return ObservedOrder(quantity, claimed, None, f"cannot be judged: rates still change, {changing}", *record)
    if verdict == "misses" and errors[first] > MAX_ERROR_FRACTION * change > 0:
        reason = f"errors are up to {errors[first]:.1e}, where it changes by {change:.1e}"
        return ObservedOrder(quantity, claimed, None, f"cannot be judged: {reason}", *record)
    return ObservedOrder(
        quantity, claimed, fit_slope(x[-1 - last :], y[-1 - last :]), verdict, *record, (end - 1 - last, end)
    )


def fit_slope(x: Array, y: Array) -> float:
    """Return the slope of the straight line through y versus x, by least squares."""
    return float(np.polyfit(x, y, 1)[0])


def assess(x: Array, y: Array, lowest: float) -> tuple[int, str]:
    """Compare four refinements with the smallest order that holds; y = -log2 of the errors, x = log2 of the steps.

    Returns:
        The number of last refinements to which the slope is fitted; ``"holds"``, ``"misses"``, or "" if undecided.
    """
    rates, fitted, last = np.diff(y) / np.diff(x), fit_slope(x, y), fit_slope(x[-1 - LAST :], y[-1 - LAST :])
    change, increments = float(np.ptp(rates)), np.diff(rates)
    if change > 2 * CONSTANT_SPREAD and last >= lowest and (fitted >= lowest or (increments > 0).all()):
        return LAST, "holds"
    if fitted >= lowest and (change <= 2 * CONSTANT_SPREAD or increments[-1] > 0):
        return REFINEMENTS, "holds"
    return REFINEMENTS, "misses" if rates[-1] + change < lowest else ""


def count_above_floors(errors: Sequence[float], floors: Sequence[float]) -> int:
    """Return the number of errors, coarse steps first, before the first error below its floor."""
    is_above = [e > f for e, f in zip(errors, floors, strict=True)]
    return is_above.index(False) if False in is_above else len(is_above)


def rates_between(ns: Sequence[int], errors: Sequence[float]) -> Array:
    """Return the rates between successive numbers of steps; ns may be longer than errors."""
    return -np.diff(np.log2(errors)) / np.diff(np.log2(ns[: len(errors)]))


def asymptotic(ns: Sequence[int], errors: Sequence[float]) -> int:
    """Return the number of errors up to the last four refinements whose rates agree; all if there are none.

    Finer steps, which other quantities require, may accumulate rounding above the estimated floor.
    """
    found = rates_between(ns, errors)
    ends = range(len(errors), REFINEMENTS, -1)
    return next((end for end in ends if np.ptp(found[end - 1 - REFINEMENTS : end - 1]) < CONSTANT_SPREAD), len(errors))


def is_complete(ns: Sequence[int], errors: Sequence[float], floors: Sequence[float]) -> bool:
    """Return whether an error reached its floor, or the rates of the four finest refinements agree."""
    if count_above_floors(errors, floors) < len(errors):
        return True
    rates = rates_between(ns, errors)[-REFINEMENTS:]
    return len(rates) == REFINEMENTS and float(np.ptp(rates)) < CONSTANT_SPREAD
