"""Errors of mbdae: one base class, and a few derived classes with data."""

import os
from collections.abc import Hashable, Iterable
from difflib import get_close_matches
from math import isfinite
from numbers import Integral, Real
from pathlib import Path
from traceback import extract_tb, format_list
from types import UnionType
from typing import Any, TypeGuard
from unicodedata import category

MAX_LISTED = 60  # longest list of names in a message
# control, format (writing direction), surrogates, line and paragraph separators
CONTROL_CATEGORIES = ("Cc", "Cf", "Cs", "Zl", "Zp")
STATUS = {
    "finished": "the end of the time span was reached",
    "event": "a terminal event occurred",
    "doubtful": "the end was reached, but the motion cannot be trusted",
    "interrupted": "stopped by the user",
    "step_size": "the step size became too small",
    "max_steps": "the largest number of steps was reached",
    "nonfinite": "a value was not finite",
    "newton": "Newton's method did not converge",
    "singular": "a linear system was singular",
    "rank": "the rank of the closures changed",
    "driver": "a driver cannot be followed there, is undefined, or its derivatives are wrong",
    "force": "a force law or another function failed",
    "impact": "an impact has no solution",
    "switching": "chattering: modes switched without end",
    "friction": "Painleve paradox: with friction there is no motion, or more than one",
    "chart": "a joint rotated too far within one step",
}
SUCCESS = ("finished", "event")  # statuses of runs that ended as requested, without accuracy warnings


def printable(text: str) -> str:
    """Return text with control characters, except line ends and tabs, escaped: they could affect a terminal."""
    if text.isprintable():  # fast path: true for nearly all texts
        return text
    return "".join(ascii(c)[1:-1] if category(c) in CONTROL_CATEGORIES and c not in "\n\t" else c for c in text)


class MbdaeError(Exception):
    """Base class of all errors that mbdae raises deliberately; the message is one line that names the object."""

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(" ".join(message.splitlines())))  # names may contain any characters

    def _render_traceback_(self) -> list[str]:
        """Return the display in IPython and notebooks: the message, and the traceback without frames of mbdae."""
        hidden = (str(Path(__file__).parent), f"{os.sep}IPython{os.sep}")
        frames = [f for f in extract_tb(self.__traceback__) if not any(path in f.filename for path in hidden)]
        lines = "".join(format_list(frames)).splitlines()
        return [f"{type(self).__name__}: {self}", *lines]

    def __reduce__(self) -> tuple:  # an error of a worker process is restored unchanged
        return _recreate, (type(self), self.args, self.__dict__)


def _recreate(kind: type[MbdaeError], args: tuple, data: dict) -> MbdaeError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(data)
    return error


class InputError(MbdaeError, ValueError):
    """Invalid user input: the message contains the expected and the actual value."""


def require(value: object, kind: type | UnionType, what: str) -> None:
    """Check the type of an argument.

    Raises:
        InputError: for another type; the message contains ``what`` and the actual value.
    """
    if not isinstance(value, kind):
        raise InputError(f"{what}, got {value!r:.60}")


def is_number(x: object) -> TypeGuard[float]:
    """Return whether an argument is a finite number."""
    try:
        return isinstance(x, Real) and not isinstance(x, bool) and isfinite(x)
    except OverflowError:  # an integer too large for a double
        return False


def is_count(x: object, least: int = 1) -> TypeGuard[int]:
    """Return whether an argument is an integer of Python or numpy, at least ``least``."""
    return isinstance(x, Integral) and not isinstance(x, bool) and int(x) >= least


def as_list(values: Any, what: str) -> list[Any]:
    """Return names as a list; a single name is a list of one.

    Raises:
        InputError: for an argument that is not iterable, or lists within it, which name nothing; the message contains
            ``what`` and the actual value.
    """
    if isinstance(values, str):
        return [values]
    require(values, Iterable, what)
    out = list(values)
    for name in out:
        require(name, Hashable, what)
    return out


class UnknownNameError(InputError):
    """An unknown name.

    Attributes:
        kind: kind of object, for instance ``"joint"``.
        name: the unknown name.
        valid: the valid names.
        what: description of the error.
        choice: description of valid input.
    """

    def __init__(self, kind: str, name: str, valid: Iterable[str]) -> None:
        self.kind, self.name, self.valid = kind, name, tuple(valid)
        closest = get_close_matches(str(name), self.valid, n=1)
        hint = f" (did you mean {closest[0]!r}?)" if closest else ""
        ellipsis = f", ... ({len(self.valid)} in all)" if len(self.valid) > MAX_LISTED else ""
        self.what = f"unknown {kind} {name!r}{hint}"
        self.choice = f"valid: {', '.join(self.valid[:MAX_LISTED]) or 'none'}{ellipsis}"
        super().__init__(f"{self.what}; {self.choice}")


class AssemblyError(MbdaeError):
    """No consistent configuration or velocity was found.

    Attributes:
        closure: name of the closure with the largest violation.
        violation: its residual norm (m, rad or dimensionless axis products; m/s at velocity level).
    """

    def __init__(self, message: str, closure: str, violation: float) -> None:
        self.closure, self.violation = closure, violation
        super().__init__(message)


class EquilibriumError(MbdaeError):
    """No equilibrium was found.

    Attributes:
        q: the configuration closest to equilibrium, as a list.
        residual: residual of the generalized forces in the null space of G at q, relative to the largest force.
        joint: joint with the largest residual.
    """

    def __init__(self, message: str, q: list[float], residual: float, joint: str) -> None:
        self.q, self.residual, self.joint = q, residual, joint
        super().__init__(message)


class NotCompiled(MbdaeError):
    """The compiled core does not support a feature of a mechanism; the message names the feature."""


class StepError(MbdaeError):
    """A failed step; `solve` converts it to a status and returns the results up to this step.

    Attributes:
        status: name of the reason, one of `mbdae.errors.STATUS`.
    """

    def __init__(self, status: str, message: str) -> None:
        self.status = status
        super().__init__(message)
