"""Methods whose steps the compiled core does not support."""

from collections.abc import Iterable
from typing import Any


def uncompiled(methods: Iterable[Any], known_reason: str) -> str:
    """Return why runs are computed in Python: a known reason, or the names of methods outside of the core; or ""."""
    names = ", ".join(dict.fromkeys(m.name for m in methods if not m.in_core))
    return known_reason or (names and f"steps of {names} in Python")
