"""Selection of a method for a formulation, from the methods of mbdae and solvers of other libraries."""

from typing import Any

from ...errors import InputError
from ...methods import EXPLICIT, METHODS, MethodLike
from ...methods import method as named_method
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
