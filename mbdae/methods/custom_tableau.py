"""Custom tableaus from a file, or from entries by name, as in the settings of a run."""

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..errors import InputError, UnknownNameError
from ..file_io import read_text
from .tableau import Tableau

KEYS = tuple(f.name for f in fields(Tableau))
REQUIRED = ("name", "A", "b")


def tableau(data: Mapping[str, Any], what: str) -> Tableau:
    """Return a tableau with the given entries, the arguments of `Tableau` by name.

    Raises:
        UnknownNameError: for an unknown entry.
        InputError: for a missing or invalid entry; the message begins with ``what``.
    """
    for key in data:
        if key not in KEYS:
            raise UnknownNameError(f"key of {what}", key, KEYS)
    missing = [key for key in REQUIRED if not data.get(key)]
    if missing:
        raise InputError(f"{what} needs {', '.join(missing)}: a tableau has {', '.join(REQUIRED)}")
    integers = {key: x for key, x in data.items() if key.startswith(("order", "project", "rounded"))}
    name = data["name"]
    if not (isinstance(name, str) and name.isprintable()) or not all(isinstance(x, int) for x in integers.values()):
        raise InputError(f"{what}: a name is a text of one line, orders are whole numbers")
    try:
        return Tableau(**data)
    except TypeError as e:
        raise InputError(f"{what}: {e}") from None


def read_tableau(path: str | Path) -> Tableau:
    """Read a tableau from a TOML file: ``name``, rows ``A``, ``b``, and further entries of `Tableau`.

    Raises:
        InputError: for a missing file, or a file without a valid tableau.
    """
    try:
        data = tomllib.loads(read_text(Path(path)))
    except tomllib.TOMLDecodeError as e:
        raise InputError(f"{path}: {e}") from None
    return tableau(data, str(path))
