"""The time span of a run."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np

from ...arguments import as_numbers
from ...errors import InputError
from ...mechanism import Driver
from ...system import Array


def checked_span(t_span: Any, *, may_be_empty: bool = False, end: bool = False) -> tuple[float, float]:
    """Return start and end of a run in s; the end may be before the start.

    Args:
        t_span: start and end, or only the end of a span from 0.
        may_be_empty: start and end may coincide.
        end: require only an end, which must be positive.

    Raises:
        InputError: for an invalid time span.
    """
    try:
        is_end = end or np.ndim(t_span) == 0
        t0, t1 = (0.0, float(t_span)) if is_end else (float(t) for t in t_span)
    except (TypeError, ValueError):
        raise InputError(f"t_span is an end, or a start and an end in s, got {t_span!r:.60}") from None
    if end and not t1 > 0:
        raise InputError(f"the end time must be positive, got {t_span}")
    if not (isfinite(t0) and isfinite(t1)) or (t0 == t1 and not may_be_empty):
        raise InputError(f"t_span must be finite{'' if may_be_empty else ' and not empty'}, got {t_span!r:.60}")
    return t0, t1


def end_of_tables(drivers: Sequence[Driver], t0: float, t1: float) -> float:
    """Return the end of a run: t1, or the end of the table of a driver without ``beyond``.

    Raises:
        InputError: if the run begins outside the table, or at its end.
    """
    last = t1
    for d in drivers:
        reason = d.outside(t1)
        end = (d.span[1] if t1 > t0 else d.span[0]) if reason else t1
        if d.outside(t0) or (end - t0) * (t1 - t0) <= 0 < abs(t1 - t0):
            raise InputError(f"{d.outside(t0) or reason}; the run begins at t = {t0:g} s")
        last = min(last, end) if t1 > t0 else max(last, end)
    return last


def checked_times(t_eval: Array, t0: float, t1: float) -> Array:
    """Return output times as an array.

    Raises:
        InputError: unless the times are ordered, in the direction of the span, and lie between t0 and t1.
    """
    times = as_numbers(t_eval)
    sign = 1.0 if t1 >= t0 else -1.0
    inside = times.ndim == 1 and len(times) and np.isfinite(times).all()
    inside = inside and sign * times[0] >= sign * t0 and sign * times[-1] <= sign * t1
    if not inside or (np.diff(times) * sign <= 0).any():
        raise InputError(f"t_eval must run from {t0} to {t1} in the span's order, got {t_eval!r:.60}")
    return times
