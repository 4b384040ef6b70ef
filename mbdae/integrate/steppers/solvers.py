"""Methods by formulation: those of mbdae, and the solvers of other libraries; which of them project positions."""

from typing import Any

from ...errors import InputError
from ...mechanism import Mechanism
from ...methods import EXPLICIT, METHODS, ExplicitMethod, MethodLike
from ...methods import method as named_method
from ...solution.solution import Problem
from .ida import IDA
from .library_solver import LibrarySolver
from .scipy_ivp import SCIPY

SOLVERS: dict[str, LibrarySolver] = {**SCIPY, IDA.name: IDA}
"""The solvers of other libraries by name."""


def find_method(formulation: str, method: MethodLike) -> Any:
    """Return the method of a given name for a formulation: a `Method`, an `ExplicitMethod` or a `LibrarySolver`.

    Raises:
        InputError: for a method of another formulation; the message lists the valid methods.
        UnknownNameError: for an unknown method.
    """
    if formulation == "index1":
        if not isinstance(method, str) or method not in (*EXPLICIT, *SCIPY):
            names = f"{', '.join(EXPLICIT)} and scipy's methods {', '.join(SCIPY)}"
            raise InputError(f"formulation 'index1' takes {names}, got {method!r}")
        return EXPLICIT.get(method) or SCIPY[method]
    if isinstance(method, str) and (method in EXPLICIT or method in SCIPY):
        valid = ", ".join((*METHODS, IDA.name))
        raise InputError(
            f"method {method!r} belongs to formulation 'index1'; formulation {formulation!r} takes {valid}"
        )
    return IDA if method == IDA.name else named_method(method)


def projects_positions(
    problem: Problem, project: bool | str, formulation: str, method: Any, step: float | None
) -> bool:
    """Return whether positions are projected after each step."""
    if project not in (True, False, "auto"):
        raise InputError(f"project is True, False or 'auto', got {project!r}")
    one_step = formulation == "index2" and not isinstance(method, LibrarySolver)
    if project == "auto":
        return isinstance(problem, Mechanism) and one_step and step is None and problem.ng > 0
    if project and not isinstance(problem, Mechanism):
        raise InputError("project=True is for mechanisms: the method itself satisfies 0 = g of a textbook problem")
    if project and not one_step and not isinstance(method, ExplicitMethod):
        others = f"{', '.join(EXPLICIT)} of 'index1'"
        valid = f"project=True is for one-step methods of formulation 'index2', and for {others}"
        raise InputError(f"{valid}; got {method.name!r} of {formulation!r}")
    return bool(project)
