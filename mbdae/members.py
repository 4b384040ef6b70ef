"""Families are folders: their members are found by looking, never typed into a list."""

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Any


def members(package: str, *kinds: type, file: str = "") -> Iterator[Any]:
    """Yield the values of some types that the files of a folder define, file by file in alphabetical order.

    Args:
        package: dotted name of the folder.
        kinds: types of the values.
        file: look into the file of this name in each folder inside, instead of all files.
    """
    path = import_module(package).__path__
    for found in iter_modules(path):
        name = f"{package}.{found.name}"
        if file and found.ispkg and file in {inner.name for inner in iter_modules(import_module(name).__path__)}:
            yield from _defined(f"{name}.{file}", kinds)
        elif not file and not found.ispkg:
            yield from _defined(name, kinds)


def _defined(module: str, kinds: tuple[type, ...]) -> Iterator[Any]:
    yield from (value for value in vars(import_module(module)).values() if isinstance(value, kinds))
