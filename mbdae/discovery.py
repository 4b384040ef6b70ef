"""Families are folders: their members are found by looking, never typed into a list.

What only has to be named, on a command line or for `dir`, is found in the text of files: nothing is imported.
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
    for point in entry_points_of(group):
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


def entry_points_of(group: str) -> Any:
    """Return the entry points of a group, see `plugins`, of which none is imported."""
    from importlib.metadata import entry_points  # slow to import, and seldom asked for

    return entry_points(group=group)


def public(package: str, files: str = "*.py") -> dict[str, str]:
    """Return the names that files list in ``__all__``, with their modules, of which none is imported."""
    lists = _written(package, r"^__all__ = (\[[^]]*\])", files)
    return {name: module for text, module in lists for name in ast.literal_eval(text)}


def classes(package: str, *bases: str) -> dict[str, str]:
    """Return the names of classes of these bases, by name, with their modules, of which none is imported."""
    return dict(_written(package, rf"^class (\w+)\((?:{'|'.join(bases)})\):"))


def instances(package: str, *kinds: str) -> list[str]:
    """Return the names of values that files make of classes, by name: ``herk1 = Tableau(``; none is imported."""
    written = _written(package, rf"^(\w+(?:, \w+)*) = \(?(?:{'|'.join(kinds)})\(")
    return [name for names, _ in written for name in names.split(", ")]


def models_directory() -> Path:
    """The folder of the models: ``mbdae/models`` when installed, ``models`` beside ``mbdae`` in a checkout."""
    found = [d for d in (PACKAGE / "models", PACKAGE.parent / "models") if d.is_dir()]
    if not found:
        raise InputError(f"the models folder is missing beside {PACKAGE}")
    return found[0]


def model_names() -> list[str]:
    """Names of the models that come with mbdae."""
    return sorted({file.parent.name for own in LIBRARY_FILES for file in models_directory().glob(f"*/{own}")})


def later(module: str, name: str) -> Callable[..., Any]:
    """Return a function that is imported when it is called: results are shown by studies, of which they know no more.

    Args:
        module: dotted name of its module.
        name: its name there.
    """

    def call(*args: Any, **named: Any) -> Any:
        return getattr(import_module(module), name)(*args, **named)

    return call


def _written(package: str, pattern: str, files: str = "*.py") -> Iterator[tuple[str, str]]:
    """The first group of a pattern, wherever it is in files, and the module where it is."""
    for module, path in _modules(package, files).items():
        yield from ((found[1], module) for found in re.finditer(pattern, path.read_text("utf-8"), re.MULTILINE))


def _modules(package: str, files: str) -> dict[str, Path]:
    """Modules of a folder of mbdae by dotted name; those with an underscore are nobody's members."""
    folder = PACKAGE.joinpath(*package.split(".")[1:])
    paths = sorted(path for path in folder.glob(files) if not path.stem.startswith("_"))
    return {".".join([package, *path.relative_to(folder).with_suffix("").parts]): path for path in paths}
