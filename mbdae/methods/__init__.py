"""Half-explicit, implicit and symplectic methods for index-2 DAEs, independent of mechanisms."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from .. import errors
from ..discovery import lazy_import, members, plugins
from ..system import System
from .alpha import GeneralizedAlpha, alpha_method
from .custom_tableau import read_tableau, tableau
from .explicit import ExplicitMethod
from .method_table import MethodTable
from .radau import RadauIIA
from .runge_kutta import RungeKutta
from .tableau import Tableau
from .variational import Composition

Method = RungeKutta | Composition | GeneralizedAlpha
MethodLike = Method | str | Path

with_proven_orders = lazy_import("mbdae.methods.order.conditions", "with_proven_orders")
_FOUND = members(__name__, *get_args(Method))
METHODS: dict[str, Method] = MethodTable({m.name: m for m in sorted(_FOUND, key=lambda m: m.name)})
"""All methods by name, discovered in the files of this folder."""

_ADDED = plugins("mbdae.methods", lambda m: isinstance(m, Tableau) and m.name not in METHODS, "a Tableau of a new name")
METHODS |= {m.name: with_proven_orders(m) if not m.order else m for m in _ADDED.values()}

EXPLICIT: dict[str, ExplicitMethod] = {m.name: m for m in members(__name__, ExplicitMethod)}
"""Methods for ordinary differential equations, which integrate the index-1 formulation."""


def method(name: MethodLike) -> Method:
    """Return a method by name, file or tableau.

    Args:
        name: one of `METHODS`, for instance ``"pherk5"``, or ``"radau7"`` to ``"radau29"`` for more stages,
            ``"alpha0.6"`` for rho_inf = 0.6; the file of a tableau, ``"mine.toml"``, or a `Tableau` itself.

    Raises:
        UnknownNameError: with the valid names.
        InputError: for a tableau with the name of another method, or an invalid file.
    """
    if not isinstance(name, str) and isinstance(name, Method):
        registered = METHODS.get(name.name, name)
        if registered != name:
            raise errors.InputError(f"{name.name!r} is the name of a method of mbdae: give the tableau another name")
        return with_proven_orders(name) if isinstance(name, Tableau) and not name.order else name
    text = str(name)
    if text.endswith(".toml"):
        return method(read_tableau(text))
    if text in METHODS:
        return METHODS[text]
    if re.fullmatch(r"radau([1-9]|[12]\d)", text) and int(text[5:]) % 2:
        return RadauIIA((int(text[5:]) + 1) // 2)
    if found := alpha_method(text):
        return found
    raise errors.UnknownNameError("method", text, METHODS)


def method_from_settings(settings: Mapping[str, Any]) -> Method:
    """Return the method of a run from its settings, which contain the complete tableau of a custom method.

    Raises:
        UnknownNameError, InputError: as for `method`.
    """
    custom = settings.get("tableau")
    return tableau(custom, "the tableau of a run") if custom else method(settings["method"])


def unsupported_reason(method: Any, system: System) -> str:
    """Return why a method cannot integrate a problem: a missing package, or an excluded feature; "" if it can."""
    if reason := getattr(method, "missing", ""):
        return str(reason)
    for kind, names in system.features.items() if method.excludes else ():
        if kind in method.excludes:
            return f"method {method.name!r} does not take {names}: {method.excludes[kind]}"
    return ""
