"""The formats of files: found as members of this folder, and among what installed packages add."""

import re
from collections.abc import Callable
from pathlib import Path

from ...discovery import instances_of, plugins
from ...errors import InputError, require
from ...file_io import read_text
from .reader import Reader

MECHANISM, PARAMETRIC = ".toml", ".py"
_OWN: tuple[Reader, ...] = (*instances_of(__package__, Reader), *instances_of(__package__, Reader, files="*/read.py"))
_TAKEN = {MECHANISM, PARAMETRIC, *(suffix for reader in _OWN for suffix in reader.suffixes)}
_ADDED = plugins(
    "mbdae.readers",
    lambda x: callable(x) or (isinstance(x, Reader) and _TAKEN.isdisjoint(x.suffixes)),
    "a function of a path, or a Reader of suffixes of its own",
)
READERS: tuple[Reader, ...] = (*_OWN, *(x for x in _ADDED.values() if isinstance(x, Reader)))
"""Readers of source files."""
SOURCES = tuple(sorted({suffix for reader in READERS for suffix in reader.suffixes}))
"""The suffixes of source files."""
CONVERTERS: dict[str, Callable[[Path], str]] = {
    f".{name}": x for name, x in _ADDED.items() if callable(x) and f".{name}" not in (*_TAKEN, *SOURCES)
}
"""Of installed packages: a suffix, and what returns the text of a mechanism file."""


def reader_of(path: Path) -> Reader:
    """Return the reader of a source file, by its first element where several have its suffix."""
    *others, last = sorted((r for r in READERS if path.suffix in r.suffixes), key=lambda r: not r.root)
    first = first_element(path) if others else ""
    return next((r for r in others if r.root == first), last)


def first_element(path: Path) -> str:
    """Return the name of the first element of an XML file."""
    found = re.search(r"<([A-Za-z][\w.-]*)", re.sub(r"<!--.*?-->", "", read_text(path), flags=re.DOTALL))
    return found[1] if found else ""


def converted(path: Path) -> str:
    """Return the text of a mechanism file from the function of an installed package.

    Raises:
        InputError: where it fails, or returns no text.
    """
    try:
        text = CONVERTERS[path.suffix](path)
    except Exception as e:  # of another package
        raise InputError(f"the reader of {path.suffix} files fails on {path}: {type(e).__name__}: {e}") from e
    require(text, str, f"the reader of {path.suffix} files returns the text of a mechanism file")
    return text
