"""Sliders of the page of a live view, in the units in which results are shown."""

import json
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import displayed, displayed_units, unit_name

STEPS = 1000  # steps of a slider


def slider(kind: str, name: str, unit: str, value: float, low: float, high: float) -> dict[str, Any]:
    """Return meshcat's command for a slider, which sends its value in SI.

    Args:
        kind: key of its requests: ``"input"``, ``"joint"`` or ``"parameter"``.
        name: name of the input, joint or parameter.
        unit: SI unit; "" if unknown.
        value: current value in SI.
        low: smallest value in SI.
        high: largest value in SI.
    """
    factor = displayed_units().factor(unit).apply(1.0)
    si = "value" if factor == 1.0 else f"value: {factor!r} * value"
    value, low, high = (float(displayed(x, unit)[0]) for x in (value, low, high))
    return {
        "type": "set_control",
        "name": slider_label(name, unit),
        "callback": f"value => live.send({{{kind}: {json.dumps(name)}, {si}}})",
        "value": value,
        "min": low,
        "max": high,
        "step": (high - low) / STEPS,
    }


def slider_label(name: str, unit: str) -> str:
    """Return the label of a slider."""
    return f"{name} ({unit_name(unit)})" if unit else name


def checked_ranges(ranges: Mapping[str, Sequence[float]]) -> dict[str, tuple[float, float]]:
    """Return ranges of sliders by name.

    Raises:
        InputError: for a range that is not two increasing numbers.
    """
    out = {}
    for name, pair in ranges.items():
        try:
            low, high = map(float, pair)
        except (TypeError, ValueError):
            low, high = np.nan, np.nan
        if not (isfinite(low) and isfinite(high) and low < high):
            raise InputError(f"the range of {name!r} must be two increasing numbers, got {pair!r}")
        out[name] = (low, high)
    return out
