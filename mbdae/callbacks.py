"""Calls of Python functions of the user, with read-only states and checked return values."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NoReturn, TypeVar

import numpy as np

from .arguments import is_real
from .errors import InputError, MbdaeError, StepError
from .system import Array

T = TypeVar("T")
FORCE = partial(StepError, "force")


def function_name(function: object) -> str:
    """Return the name of a Python function for messages."""
    return getattr(function, "__name__", type(function).__name__)


def call_and_report(
    what: str, call: Callable[[], T], where: Callable[[], str] = str, error: Callable[[str], MbdaeError] = InputError
) -> T:
    """Call a user function; the error of a failure contains ``what`` failed, and at which time or values, if any.

    Raises:
        MbdaeError: ``error``, with the user's exception as its cause.
    """
    try:
        return call()
    except Exception as e:
        report(e, what, where(), error)


def report(e: Exception, what: str, where: str, error: Callable[[str], MbdaeError]) -> NoReturn:
    """Raise the error of a user function that failed; errors of mbdae are raised unchanged.

    Raises:
        MbdaeError: ``error``, with the user's exception as its cause.
    """
    if isinstance(e, MbdaeError):
        raise e
    raise error(f"{what} failed{where and f' at {where}'}: {type(e).__name__}: {e}") from e


def values_text(values: Mapping[str, float]) -> str:
    """Return named numbers as text."""
    return ", ".join(f"{name} = {x:.9g}" for name, x in values.items())


def call_with_views(what: str, function: Callable[..., T], t: float | None, *arrays: Array) -> T:
    """Call a user function of (t, arrays ...), or of arrays only, with read-only views of the arrays.

    Raises:
        StepError: if the function raises an error.
    """
    views = map(read_only, arrays)
    return call_and_report(what, lambda: function(*(() if t is None else (t,)), *views), lambda: _time(t), FORCE)


def read_only(x: Array) -> Array:
    """Return a read-only view of an array; the array itself if it is read-only."""
    if not x.flags.writeable:
        return x
    view = x.view()
    view.setflags(write=False)
    return view


def checked_value(value: Any, shape: tuple[int, ...], t: float | None, what: str) -> Array:
    """Return the value of a user function as a new array.

    Raises:
        StepError: for another shape, or values that are not finite real numbers.
    """
    when = _at(t, ",")
    try:
        if value is None or not is_real(np.asarray(value)):
            raise TypeError
        out: Array = np.array(value, float)  # a copy: the function may return the same array at each call
    except (TypeError, ValueError):
        raise StepError("force", f"{what} returned {value!r:.80}, expected {_shape_text(shape)}{when}") from None
    if out.shape != shape:
        raise StepError("force", f"{what} returned shape {out.shape}, expected {_shape_text(shape)}{when}")
    if not np.isfinite(out).all():
        raise StepError("nonfinite", f"{what} returned {out}{_at(t)}")
    return out


def _shape_text(shape: tuple[int, ...]) -> str:
    return f"shape {shape}" if shape else "a number"


def _time(t: float | None) -> str:
    return "" if t is None else f"t = {t:.17g}"


def _at(t: float | None, comma: str = "") -> str:
    return "" if t is None else f"{comma} at {_time(t)}"
