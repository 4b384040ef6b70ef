"""Families are folders: their members are found by looking, never typed into a list."""

import ast
import re
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any


def members(package: str, *kinds: type, files: str = "*.py") -> Iterator[Any]:
    """Yield the values of some types that the files of a folder define, file by file in alphabetical order.

    Args:
        package: dotted name of the folder.
        kinds: types of the values.
        files: which of its files, or of those in folders inside: ``"*/command.py"``.
    """
    for module in _modules(package, files):
        yield from (value for value in vars(import_module(module)).values() if isinstance(value, kinds))


def plugins(group: str, fits: Callable[[Any], bool], what: str) -> dict[str, Any]:
    """Return what installed packages add to a family, by the names of their entry points; what is wrong is warned of.

    Args:
        group: ``"mbdae.methods"``, ``"mbdae.forces"`` or ``"mbdae.readers"``.
        fits: whether a value belongs to the family.
        what: what it should be, in words.
    """
    out: dict[str, Any] = {}
    for point in entry_points(group=group):
        where = f"entry point {point.name!r} of {group} in {point.dist.name if point.dist else 'a package'}"
        try:
            value = point.load()
        except Exception as e:  # of another package: mbdae goes on without it
            warnings.warn(f"{where} is left out: {type(e).__name__}: {e}", stacklevel=2)
            continue
        if fits(value):
            out[point.name] = value
        else:
            warnings.warn(f"{where} is left out: expected {what}, got {value!r:.60}", stacklevel=2)
    return out


def public(package: str, files: str = "*.py") -> dict[str, str]:
    """Return the names that files list in ``__all__``, with their modules, of which none is imported."""
    out: dict[str, str] = {}
    for module, path in _modules(package, files).items():
        found = re.search(r"^__all__ = (\[[^]]*\])", path.read_text("utf-8"), re.MULTILINE)
        out |= dict.fromkeys(ast.literal_eval(found[1]), module) if found else {}
    return out


def _modules(package: str, files: str) -> dict[str, Path]:
    """Modules of a folder by dotted name; those with an underscore are nobody's members."""
    folder = Path(str(import_module(package).__file__)).parent
    paths = sorted(path for path in folder.glob(files) if not path.stem.startswith("_"))
    return {".".join([package, *path.relative_to(folder).with_suffix("").parts]): path for path in paths}
