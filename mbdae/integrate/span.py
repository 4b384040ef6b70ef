"""The time span of a run."""

from typing import Any

import numpy as np

from ..errors import InputError


def checked_span(t_span: Any, *, pair: bool = False, end: bool = False) -> tuple[float, float]:
    """Return start and end of a run in s; the end may lie before the start.

    Args:
        t_span: start and end, or an end alone for a span from 0.
        pair: reject an end alone; start and end may coincide.
        end: require an end alone, which is positive.

    Raises:
        InputError: for an invalid time span.
    """
    try:
        alone = end or (np.ndim(t_span) == 0 and not pair)
        t0, t1 = (0.0, float(t_span)) if alone else (float(t) for t in t_span)
    except (TypeError, ValueError):
        expected = "a pair of times" if pair else "an end, or a start and an end in s"
        raise InputError(f"t_span is {expected}, got {t_span!r:.60}") from None
    if end and not t1 > 0:
        raise InputError(f"the end time must be positive, got {t_span}")
    if not np.isfinite([t0, t1]).all() or (t0 == t1 and not pair):
        raise InputError(f"t_span must be finite{'' if pair else ' and not empty'}, got {t_span!r:.60}")
    return t0, t1
