"""How time advances: half-explicit and Radau IIA Runge-Kutta methods for index-2 DAEs. Knows nothing of mechanisms."""

import re

from .. import errors
from ..members import members
from .explicit import ExplicitMethod
from .radau import Method, RadauIIA
from .tableau import Tableau

METHODS: dict[str, Method] = {m.name: m for m in sorted(members(__name__, Tableau, RadauIIA), key=lambda m: m.name)}
"""Every method by name, found in the files of this folder: a method that exists cannot be missing here."""

EXPLICIT: dict[str, ExplicitMethod] = {m.name: m for m in members(__name__, ExplicitMethod)}
"""Methods for ordinary differential equations, which step accelerations."""


def method(name: str) -> Method:
    """Look a method up.

    Args:
        name: one of `METHODS`, for instance ``"pherk5"``, or ``"radau7"`` to ``"radau29"`` for more stages.

    Raises:
        UnknownNameError: with the names that exist.
    """
    text = str(name)
    if re.fullmatch(r"radau([1-9]|[12]\d)", text) and int(text[5:]) % 2:
        return METHODS.get(text) or RadauIIA((int(text[5:]) + 1) // 2)
    if text not in METHODS:
        raise errors.UnknownNameError("method", name, METHODS)
    return METHODS[text]
