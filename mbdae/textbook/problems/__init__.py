"""The problems of textbooks: a file each, whose ``__all__`` names the function that makes it."""

import copyreg
from collections.abc import Callable
from importlib import import_module
from typing import Any

from ...discovery import public
from ..hessenberg import Hessenberg

TEXTBOOK: dict[str, Callable[[], Hessenberg]] = {
    name: getattr(import_module(module), name) for name, module in public(__name__).items()
}
"""Every problem by name."""
globals().update(TEXTBOOK)  # a problem's name is that of its function, and not of the file


def listed(problem: Hessenberg) -> bool:
    """Whether a problem is one of these, with its own start: then its name says all of it, in files and to workers."""
    own = TEXTBOOK[problem.name]() if problem.name in TEXTBOOK else None
    return own is not None and (own.y0, own.z0, own.title) == (problem.y0, problem.z0, problem.title)


def _make(name: str) -> Hessenberg:
    return TEXTBOOK[name]()


def _reduced(problem: Hessenberg) -> Any:
    return (_make, (problem.name,)) if listed(problem) else object.__reduce_ex__(problem, 2)


copyreg.pickle(Hessenberg, _reduced)  # type: ignore[arg-type]
