"""Families are folders whose members are discovered, never listed by hand.

Names for a command line or for `dir` are found in the text of files, without importing them.
"""

import ast
import re
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from .errors import InputError

LIBRARY_FILES = ("mechanism.toml", "mechanism.py")  # in the folder of a model that comes with mbdae
PACKAGE = Path(__file__).resolve().parent


def members(package: str, *kinds: type, files: str = "*.py") -> Iterator[Any]:
    """Yield the values of some types that the files of a folder define, file by file in alphabetical order.

    Args:
        package: dotted name of the folder.
        kinds: types of the values.
        files: a pattern of its files, or of those in subfolders: ``"*/command.py"``.
    """
    for module in _modules(package, files):
        yield from (value for value in vars(import_module(module)).values() if isinstance(value, kinds))


def plugins(group: str, fits: Callable[[Any], bool], what: str) -> dict[str, Any]:
    """Return members that installed packages add to a family, by entry-point name; warn of invalid ones.

    Args:
        group: ``"mbdae.methods"``, ``"mbdae.forces"``, ``"mbdae.closures"`` or ``"mbdae.readers"``.
        fits: whether a value belongs to the family.
        what: the expected kind, in words.
    """
    out: dict[str, Any] = {}
    for point in entry_points_of(group):
        where = f"entry point {point.name!r} of {group} in {point.dist.name if point.dist else 'a package'}"
        try:
            value = point.load()
        except Exception as e:  # of another package: mbdae continues without it
            warnings.warn(f"{where} is left out: {type(e).__name__}: {e}", stacklevel=2)
            continue
        if fits(value):
            out[point.name] = value
        else:
            warnings.warn(f"{where} is left out: expected {what}, got {value!r:.60}", stacklevel=2)
    return out


def entry_points_of(group: str) -> Any:
    """Return the entry points of a group, see `plugins`, without importing them."""
    from importlib.metadata import entry_points  # slow to import, and rarely needed

    return entry_points(group=group)


def public(package: str, files: str = "*.py") -> dict[str, str]:
    """Return the names that files list in ``__all__``, with their modules, without importing them."""
    lists = _written(package, r"^__all__ = (\[[^]]*\])", files)
    return {name: module for text, module in lists for name in ast.literal_eval(text)}


def classes(package: str, *bases: str) -> dict[str, str]:
    """Return the names of classes with these bases, with their modules, without importing them."""
    return dict(_written(package, rf"^class (\w+)\((?:{'|'.join(bases)})\):"))


def instances(package: str, *kinds: str) -> list[str]:
    """Return the names of instances that files create, by name: ``herk1 = Tableau(``; without importing them."""
    written = _written(package, rf"^(\w+(?:, \w+)*) = \(?(?:{'|'.join(kinds)})\(")
    return [name for names, _ in written for name in names.split(", ")]


def made(package: str, kind: type, files: str = "*.py") -> Iterator[Any]:
    """Yield the values that files of a folder make of a class, ``urdf = Reader(``; other files are not imported."""
    for name, module in _written(package, rf"^(\w+) = {kind.__name__}\(", files):
        yield getattr(import_module(module), name)


def models_directory() -> Path:
    """Return the folder of the models: ``mbdae/models`` when installed, ``models`` next to ``mbdae`` in a checkout."""
    found = [d for d in (PACKAGE / "models", PACKAGE.parent / "models") if d.is_dir()]
    if not found:
        raise InputError(f"the models folder is missing beside {PACKAGE}")
    return found[0]


def model_names() -> list[str]:
    """Return names of the models that come with mbdae."""
    return sorted({file.parent.name for own in LIBRARY_FILES for file in models_directory().glob(f"*/{own}")})


def later(module: str, name: str) -> Callable[..., Any]:
    """Return a function that is imported when called.

    Results use studies, but do not depend on them; and parts of scipy take time to import that few runs need.

    Args:
        module: dotted name of its module.
        name: its name there.
    """

    def call(*args: Any, **named: Any) -> Any:
        return getattr(import_module(module), name)(*args, **named)

    return call


def _written(package: str, pattern: str, files: str = "*.py") -> Iterator[tuple[str, str]]:
    """Yield the first group of a pattern, wherever it occurs in files, and the module."""
    for module, path in _modules(package, files).items():
        yield from ((found[1], module) for found in re.finditer(pattern, path.read_text("utf-8"), re.MULTILINE))


def _modules(package: str, files: str) -> dict[str, Path]:
    """Return modules of a folder of mbdae by dotted name, except those with a leading underscore."""
    folder = PACKAGE.joinpath(*package.split(".")[1:])
    paths = sorted(path for path in folder.glob(files) if not path.stem.startswith("_"))
    return {".".join([package, *path.relative_to(folder).with_suffix("").parts]): path for path in paths}
