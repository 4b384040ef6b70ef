"""Methods with fixed steps alone, computed in Python."""

from collections.abc import Iterable
from typing import Any

from .alpha import GeneralizedAlpha
from .variational import Composition

FIXED_STEP = Composition, GeneralizedAlpha


def uncompiled(methods: Iterable[Any], because: str) -> str:
    """Return why methods are computed in Python: a known reason, or the names of those whose steps are; or ""."""
    names = ", ".join(dict.fromkeys(m.name for m in methods if isinstance(m, FIXED_STEP)))
    return because or (names and f"steps of {names} in Python")
