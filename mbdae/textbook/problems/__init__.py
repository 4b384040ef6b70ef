"""Textbook problems: one file each, whose ``__all__`` names the function that creates it."""

import copyreg
from collections.abc import Callable
from importlib import import_module
from typing import Any

from ...discovery import public_names
from ..hessenberg import Hessenberg
from ..mixed import MixedHessenberg

TEXTBOOK: dict[str, Callable[[], Hessenberg]] = {
    name: getattr(import_module(module), name) for name, module in public_names(__name__).items()
}
"""Every problem by name."""
globals().update(TEXTBOOK)  # a problem has the name of its function, not of the file


def listed(problem: Hessenberg) -> bool:
    """Return whether a problem is one of these, with its default start: then its name identifies it."""
    own = TEXTBOOK[problem.name]() if problem.name in TEXTBOOK else None
    return own is not None and (own.y0, own.z0, own.title) == (problem.y0, problem.z0, problem.title)


def _make(name: str) -> Hessenberg:
    return TEXTBOOK[name]()


def _reduced(problem: Hessenberg) -> Any:
    return (_make, (problem.name,)) if listed(problem) else object.__reduce_ex__(problem, 2)


for kind in (Hessenberg, MixedHessenberg):
    copyreg.pickle(kind, _reduced)  # type: ignore[arg-type]
