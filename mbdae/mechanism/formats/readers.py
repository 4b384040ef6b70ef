"""All file formats: of this folder, and of installed packages."""

import re
from collections.abc import Callable
from pathlib import Path

from ...discovery import instances_of, plugins
from ...errors import InputError, require
from ...file_io import read_text
from .reader import Reader

MECHANISM, PARAMETRIC = ".toml", ".py"
_BUILT_IN: tuple[Reader, ...] = (
    *instances_of(__package__, Reader),
    *instances_of(__package__, Reader, files="*/read.py"),
)
_RESERVED = {MECHANISM, PARAMETRIC, *(suffix for reader in _BUILT_IN for suffix in reader.suffixes)}
_PLUGINS = plugins(
    "mbdae.readers",
    lambda x: callable(x) or (isinstance(x, Reader) and _RESERVED.isdisjoint(x.suffixes)),
    "a function of a path, or a Reader of other suffixes",
)
READERS: tuple[Reader, ...] = (*_BUILT_IN, *(x for x in _PLUGINS.values() if isinstance(x, Reader)))
"""Readers of source files."""
SOURCES = tuple(sorted({suffix for reader in READERS for suffix in reader.suffixes}))
"""The suffixes of source files."""
CONVERTERS: dict[str, Callable[[Path], str]] = {
    f".{name}": x for name, x in _PLUGINS.items() if callable(x) and f".{name}" not in (*_RESERVED, *SOURCES)
}
"""Functions of installed packages that return the text of a mechanism file, by suffix."""


def reader_of(path: Path) -> Reader:
    """Return the reader of a source file; the root element decides if several readers have its suffix."""
    *specific, default = sorted((r for r in READERS if path.suffix in r.suffixes), key=lambda r: not r.root)
    first = first_element(path) if specific else ""
    return next((r for r in specific if r.root == first), default)


def first_element(path: Path) -> str:
    """Return the name of the first element of an XML file."""
    found = re.search(r"<([A-Za-z][\w.-]*)", re.sub(r"<!--.*?-->", "", read_text(path), flags=re.DOTALL))
    return found[1] if found else ""


def converted(path: Path) -> str:
    """Return the text of a mechanism file from the function of an installed package.

    Raises:
        InputError: if the function fails, or does not return text.
    """
    try:
        text = CONVERTERS[path.suffix](path)
    except Exception as e:  # raised by another package
        raise InputError(f"the reader of {path.suffix} files fails on {path}: {type(e).__name__}: {e}") from e
    require(text, str, f"the reader of {path.suffix} files returns the text of a mechanism file")
    return text
