"""Conversion of arguments of public functions to numbers."""

import numpy as np

from .errors import InputError
from .system import Array


def is_real(x: Array) -> bool:
    """Return whether an array has real numbers: no booleans, strings, complex numbers or dates."""
    return x.dtype.kind not in "bSUcmM"


def as_numbers(value: object) -> Array:
    """Return an argument as an array of numbers; nan, which checks reject, for other values and masked entries."""
    try:
        array = np.asarray(value)
        out = array.astype(float) if is_real(array) else np.array(np.nan)
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)
    mask = getattr(value, "mask", None)  # of a numpy.ma array; numpy.ma takes time to import
    if isinstance(mask, np.ndarray):
        out[mask] = np.nan
    return out


def number(name: str, value: object) -> float:
    """Return a value as a finite number.

    Raises:
        InputError: for any other value.
    """
    x = as_numbers(value)
    if x.shape or not np.isfinite(x):
        raise InputError(f"{name} is a finite number, got {value!r}")
    return float(x)
