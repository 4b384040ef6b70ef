"""Arguments of public functions as numbers."""

import numpy as np

from .errors import InputError
from .system import Array


def as_numbers(value: object) -> Array:
    """Return an argument as an array of numbers; nan for any other, which checks of finite numbers reject."""
    try:
        given = np.asarray(value)
        return np.array(np.nan) if given.dtype.kind in "bSU" else given.astype(float)
    except (TypeError, ValueError):
        return np.array(np.nan)


def number(name: str, value: object) -> float:
    """Return a value as a finite number.

    Raises:
        InputError: for any other value.
    """
    x = as_numbers(value)
    if x.shape or not np.isfinite(x):
        raise InputError(f"{name} is a finite number, got {value!r}")
    return float(x)
