"""Settings of a run: from its arguments, else from the mechanism file, else the defaults."""

from collections.abc import Mapping
from typing import Any

from ...errors import UnknownNameError
from ...mechanism import Mechanism
from ...solution.solution import Problem
from ..steppers.solvers import find_method
from .defaults import DEFAULTS

METHOD_SETTINGS, CONTROL_SETTINGS = ("formulation", "project", "baumgarte"), ("rtol", "atol")


def complete_settings(problem: Problem, given: Mapping[str, object]) -> dict[str, Any]:
    """Return the settings of a run, where None means not given.

    Raises:
        UnknownNameError, InputError: for an invalid method in the mechanism file.
    """
    arguments = {name: x for name, x in given.items() if x is not None}
    from_file = _file_settings(problem)
    if not from_file:
        return DEFAULTS | arguments
    overridden = set(METHOD_SETTINGS if "method" in arguments or "formulation" in arguments else ())
    overridden |= set(CONTROL_SETTINGS if "step" in arguments else ())
    overridden |= {"step"} if any(name in arguments for name in CONTROL_SETTINGS) else set()
    settings = {**DEFAULTS, **{name: x for name, x in from_file.items() if name not in overridden}, **arguments}
    if "method" in from_file and "method" not in arguments:
        try:
            find_method(settings["formulation"], settings["method"])
        except UnknownNameError as e:
            raise UnknownNameError(f"solve.{e.kind}", e.name, e.valid) from None
    return settings


def _file_settings(problem: Problem) -> dict[str, Any]:
    """Return the settings of the mechanism file."""
    return problem.settings.given if isinstance(problem, Mechanism) else {}
