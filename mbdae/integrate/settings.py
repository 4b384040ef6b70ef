"""Settings of a run: those given, then those of the mechanism's file, then the defaults."""

from collections.abc import Mapping
from typing import Any

from ..errors import UnknownNameError
from ..mechanism import Mechanism
from ..solution.solution import Problem
from .defaults import DEFAULTS
from .steppers.scipy_ivp import find

OF_METHOD, OF_CONTROL = ("formulation", "project", "baumgarte"), ("rtol", "atol")


def completed(problem: Problem, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a run, where None means not given.

    Raises:
        UnknownNameError, InputError: for an invalid method in the mechanism's file.
    """
    said = {name: x for name, x in given.items() if x is not None}
    own = _own(problem)
    left = set(OF_METHOD if "method" in said or "formulation" in said else ())
    left |= set(OF_CONTROL if "step" in said else ())
    left |= {"step"} if any(name in said for name in OF_CONTROL) else set()
    found = {**DEFAULTS, **{name: x for name, x in own.items() if name not in left}, **said}
    if "method" in own and "method" not in said:
        try:
            find(found["formulation"], found["method"])
        except UnknownNameError as e:
            raise UnknownNameError(f"solve.{e.kind}", e.name, e.valid) from None
    return found


def _own(problem: Problem) -> dict[str, Any]:
    """Return the settings from a mechanism's file."""
    return problem.settings.given if isinstance(problem, Mechanism) else {}
