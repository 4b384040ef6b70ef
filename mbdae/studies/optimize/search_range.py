"""Bounds of parameters, limits of constraints, and scales of a search."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ...errors import InputError, MbdaeError, UnknownNameError, require
from ...mechanism.discrete_sensitivity.parameter_direction import SMALL
from ...system import Array
from ..factories import MechanismFactory
from ..sensitivity.run_parameters import checked_scales, entries, reals


def require_within_bounds(start: Mapping[str, float], box: Mapping[str, tuple[float, float]]) -> None:
    """Require that the start is within the bounds.

    Raises:
        InputError: for a parameter that starts outside its bounds.
    """
    for name, x in start.items():
        low, high = box[name]
        if not low <= x <= high:
            raise InputError(f"parameter {name!r} starts at {x:g}, outside its bounds {low:g} to {high:g}")


def effective_bounds(
    factory: MechanismFactory, start: Mapping[str, float], box: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Return the bounds of parameters, with 0 in place of infinity if mechanisms exist on one side of 0 only.

    Without this bound, a line search could not reach 0, since it rejects all points beyond.
    """
    no_low = [n for n, pair in box.items() if pair[0] == -np.inf and start[n] >= 0]
    no_high = [n for n, pair in box.items() if pair[1] == np.inf and start[n] <= 0]
    low = _limited_by_zero(factory, start, no_low, -SMALL)
    high = _limited_by_zero(factory, start, no_high, SMALL)
    return {n: (0.0 if n in low else pair[0], 0.0 if n in high else pair[1]) for n, pair in box.items()}


def _limited_by_zero(
    factory: MechanismFactory, start: Mapping[str, float], names: Sequence[str], beyond: float
) -> list[str]:
    """Return the parameters for which no mechanism exists beyond 0; none if it exists with all of them beyond 0."""
    if not names or _exists(factory, {**start, **dict.fromkeys(names, beyond)}):
        return []
    return [n for n in names if not _exists(factory, {**start, n: beyond}) and _exists(factory, {**start, n: 0.0})]


def _exists(factory: MechanismFactory, values: dict[str, float]) -> bool:
    with suppress(MbdaeError):
        factory.make(values)
        return True
    return False


def ranges(
    kind: str, names: Mapping[str, object], given: Mapping[str, Sequence[float | None]]
) -> dict[str, tuple[float, float]]:
    """Return (low, high) of each name, infinite if not given.

    Raises:
        InputError, UnknownNameError: for invalid ranges or names.
    """
    for name in given:
        if name not in names:
            raise UnknownNameError(kind, name, names)
    return {name: _pair(f"{kind} {name!r}", given.get(name, (None, None))) for name in names}


def table_by_name(kind: str, given: Any) -> Mapping[str, Any]:
    """Return a table, empty for None."""
    require(given if given is not None else {}, Mapping, f"{kind} are a table by name")
    return given or {}


def constraint_limits(name: str, given: object) -> tuple[float, float]:
    """Return the limits of a constraint (function, low, high)."""
    if not (isinstance(name, str) and name):
        raise InputError(f"constraints have names, non-empty texts, got {name!r:.60}")
    if not (isinstance(given, Sequence) and len(given) == 3 and callable(given[0])):
        raise InputError(f"constraint {name!r} takes (function, low, high), got {given!r:.60}")
    found = _pair(f"constraint {name!r}", given[1:])
    if not np.isfinite(found).any():
        raise InputError(f"constraint {name!r} has no limit: give low, high or both")
    return found


def _pair(label: str, given: object) -> tuple[float, float]:
    """Return the lower and the upper limit of a range.

    Raises:
        InputError: for an invalid range.
    """
    pair = entries(given)
    ends = reals([infinity if x is None else x for x, infinity in zip(pair, (-np.inf, np.inf), strict=False)])
    if not (len(pair) == len(ends) == 2 and ends[0] <= ends[1] and ends[0] < np.inf and ends[1] > -np.inf):
        raise InputError(f"{label} takes (low, high) with low <= high, None for no limit, got {given!r:.60}")
    return ends[0], ends[1]


def parameter_scales(start: Mapping[str, float], box: Mapping[str, tuple[float, float]], given: object) -> Array:
    """Return typical changes of the parameters, (k,)."""
    default = {}
    for name, x in start.items():
        width = box[name][1] - box[name][0]
        default[name] = (width if np.isfinite(width) else abs(x) or 10.0) / 10 or 1.0
    return checked_scales(given, default)
