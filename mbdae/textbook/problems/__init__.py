"""The problems of textbooks: a file each, whose ``__all__`` names the function that makes it."""

from collections.abc import Callable
from importlib import import_module

from ...members import public
from ..hessenberg import Hessenberg

TEXTBOOK: dict[str, Callable[[], Hessenberg]] = {
    name: getattr(import_module(module), name) for name, module in public(__name__).items()
}
"""Every problem by name."""
globals().update(TEXTBOOK)  # a problem's name is that of its function, and not of the file
