"""Custom methods: from a table, from a file, and from the settings of a run."""

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..errors import InputError, UnknownNameError
from ..file_io import read_text
from .tableau import Tableau

KEYS = tuple(f.name for f in fields(Tableau))
NEEDED = ("name", "A", "b")


def tableau(data: Mapping[str, Any], what: str) -> Tableau:
    """Make a tableau from its entries by name, those of `Tableau`.

    Raises:
        UnknownNameError: for an unknown entry.
        InputError: for one that is missing or wrong; ``what`` names the place.
    """
    for key in data:
        if key not in KEYS:
            raise UnknownNameError(f"key of {what}", key, KEYS)
    missing = [key for key in NEEDED if not data.get(key)]
    if missing:
        raise InputError(f"{what} needs {', '.join(missing)}: a tableau has {', '.join(NEEDED)}")
    numbers = {key: x for key, x in data.items() if key.startswith(("order", "project", "rounded"))}
    name = data["name"]
    if not (isinstance(name, str) and name.isprintable()) or not all(isinstance(x, int) for x in numbers.values()):
        raise InputError(f"{what}: a name is a text of one line, orders are whole numbers")
    try:
        return Tableau(**data)
    except TypeError as e:
        raise InputError(f"{what}: {e}") from None


def read_tableau(path: str | Path) -> Tableau:
    """Read a tableau from a TOML file: ``name``, rows ``A``, ``b``, and further entries of `Tableau`.

    Raises:
        InputError: for a file that is missing, or not a tableau.
    """
    try:
        data = tomllib.loads(read_text(Path(path)))
    except tomllib.TOMLDecodeError as e:
        raise InputError(f"{path}: {e}") from None
    return tableau(data, str(path))
