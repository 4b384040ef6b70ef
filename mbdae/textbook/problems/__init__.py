"""Textbook problems: one file each, whose ``__all__`` contains the function that creates the problem."""

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
globals().update(TEXTBOOK)  # a problem is named after its function, not its file


def listed(problem: Hessenberg) -> bool:
    """Return whether a problem is one of `TEXTBOOK` with its default start, so that its name identifies it."""
    default = TEXTBOOK[problem.name]() if problem.name in TEXTBOOK else None
    return default is not None and (default.y0, default.z0, default.title) == (problem.y0, problem.z0, problem.title)


def _make(name: str) -> Hessenberg:
    return TEXTBOOK[name]()


def _reduced(problem: Hessenberg) -> Any:
    return (_make, (problem.name,)) if listed(problem) else object.__reduce_ex__(problem, 2)


for kind in (Hessenberg, MixedHessenberg):
    copyreg.pickle(kind, _reduced)  # type: ignore[arg-type]
