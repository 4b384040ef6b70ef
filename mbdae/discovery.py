"""Members of a family (methods, forces, closures, readers): modules of its folder, and entry points of packages.

Names for the command line and for `dir` are read from the text of the files, which are not imported.
"""

import ast
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from .errors import InputError

MODEL_LIST = "models.json"  # in the folder of the models: their sizes and parameters; tests/key_tables.py writes it
LIBRARY_FILES = ("mechanism.toml", "mechanism.py")  # in the folder of a model that comes with mbdae
PACKAGE = Path(__file__).resolve().parent


class Members(MutableMapping[str, Any]):
    """Members of a family by name, in alphabetical order; each is imported on first access.

    Args:
        modules: dotted names of their modules by name.
        member: returns the member of a module with a given name.
    """

    def __init__(self, modules: Mapping[str, str], member: Callable[[Any, str], Any] = getattr) -> None:
        self._modules, self._member = dict(modules), member
        self._found: dict[str, Any] = dict.fromkeys(sorted(modules))

    def __getitem__(self, name: str) -> Any:
        if module := self._modules.get(name):
            self[name] = self._member(import_module(module), name)
        return self._found[name]

    def __setitem__(self, name: str, value: Any) -> None:
        self._found[name] = value  # first, so that other threads find it when its module is removed
        self._modules.pop(name, None)

    def __delitem__(self, name: str) -> None:
        self._modules.pop(name, None)
        del self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


def members(package: str, *kinds: type, files: str = "*.py") -> Iterator[Any]:
    """Yield the values of given types that the files of a folder define, file by file in alphabetical order.

    Args:
        package: dotted name of the folder.
        kinds: types of the values.
        files: pattern of the files in the folder, or in its subfolders: ``"*/command.py"``.
    """
    for module in _modules(package, files):
        yield from (value for value in vars(import_module(module)).values() if isinstance(value, kinds))


def plugins(group: str, is_member: Callable[[Any], bool], what: str) -> dict[str, Any]:
    """Return members that installed packages add to a family, by entry-point name; warn about invalid ones.

    Args:
        group: ``"mbdae.methods"``, ``"mbdae.forces"``, ``"mbdae.closures"`` or ``"mbdae.readers"``.
        is_member: whether a value belongs to the family.
        what: description of a valid value, for warnings.
    """
    out: dict[str, Any] = {}
    for point in entry_points_of(group):
        where = f"entry point {point.name!r} of {group} in {point.dist.name if point.dist else 'a package'}"
        try:
            value = point.load()
        except Exception as e:  # an error in another package must not stop mbdae
            warnings.warn(f"{where} is ignored: {type(e).__name__}: {e}", stacklevel=2)
            continue
        if is_member(value):
            out[point.name] = value
        else:
            warnings.warn(f"{where} is ignored: expected {what}, got {value!r:.60}", stacklevel=2)
    return out


def entry_points_of(group: str) -> Any:
    """Return the entry points of a group, see `plugins`, without importing them."""
    return _entry_points().select(group=group)


@cache  # all installed packages are searched, for any group
def _entry_points() -> Any:
    from importlib.metadata import entry_points  # slow to import, and rarely needed

    return entry_points()


def public_names(package: str, files: str = "*.py") -> dict[str, str]:
    """Return the names that files list in ``__all__``, with their modules, without importing them."""
    matches = _matches(package, r"^__all__ = (\[[^]]*\])", files)
    return {name: module for text, module in matches for name in ast.literal_eval(text)}


def class_names(package: str, *bases: str) -> dict[str, str]:
    """Return the names of classes derived from the given bases, with their modules, without importing them."""
    return dict(_matches(package, rf"^class (\w+)\((?:{'|'.join(bases)})\):"))


def command_names(package: str) -> dict[str, str]:
    """Return the names of the commands of a folder's subfolders, with their modules, without importing them."""
    matches = _matches(package, r"^@(?:click\.|study_)?command\([\s\S]*?^def (\w+)", "*/command.py")
    return {name.replace("_", "-"): module for name, module in matches}


def instance_names(package: str, *kinds: str) -> list[str]:
    """Return the names of module-level instances, as in ``herk1 = Tableau(``, without importing them."""
    matches = _matches(package, rf"^(\w+(?:, \w+)*) = \(?(?:{'|'.join(kinds)})\(")
    return [name for names, _ in matches for name in names.split(", ")]


def instances_of(package: str, kind: type, files: str = "*.py") -> Iterator[Any]:
    """Yield the module-level instances of a class, as in ``urdf = Reader(``; other files are not imported."""
    for name, module in _matches(package, rf"^(\w+) = {kind.__name__}\(", files):
        yield getattr(import_module(module), name)


def models_directory() -> Path:
    """Return the folder of the models: ``mbdae/models`` when installed, ``models`` next to ``mbdae`` in a checkout."""
    folders = [d for d in (PACKAGE / "models", PACKAGE.parent / "models") if d.is_dir()]
    if not folders:
        raise InputError(f"the models folder is missing next to {PACKAGE}")
    return folders[0]


@cache  # the list of files of a distribution takes 20 ms to read
def robots_directory() -> Path:
    """Return the folder of robot descriptions that example-robot-data installs."""
    from importlib.metadata import PackageNotFoundError, distribution  # slow to import

    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        what = "this needs the robots of the package 'example-robot-data', which is not installed"
        raise InputError(f"{what}: pip install example-robot-data") from None
    urdf = next((f for f in files if f.suffix == ".urdf" and "robots" in f.parts), None)
    if urdf is None:
        raise InputError("example-robot-data contains no robots")
    depth = len(urdf.parts) - urdf.parts.index("robots") - 1
    return Path(str(urdf.locate())).parents[depth - 1]


def model_names() -> list[str]:
    """Return names of the models that come with mbdae."""
    return sorted({file.parent.name for name in LIBRARY_FILES for file in models_directory().glob(f"*/{name}")})


def is_model_name(name: str) -> bool:
    """Return whether a model of this name comes with mbdae; cheaper than a list of all names."""
    folder = models_directory()
    return name in os.listdir(folder) and any((folder / name / file).is_file() for file in LIBRARY_FILES)


def lazy_import(module: str, name: str) -> Callable[..., Any]:
    """Return a function that is imported when it is first called.

    This lets results call studies without importing them, and avoids parts of scipy that are slow to import.

    Args:
        module: dotted name of the module of the function.
        name: name of the function.
    """

    def call(*args: Any, **named: Any) -> Any:
        return getattr(import_module(module), name)(*args, **named)

    return call


def texts(package: str) -> dict[str, str]:
    """Return the source text of each file of a folder, by module."""
    return {module: path.read_text("utf-8") for module, path in _modules(package, "*.py").items()}


def _matches(package: str, pattern: str, files: str = "*.py") -> Iterator[tuple[str, str]]:
    """Yield the first group of each match of a pattern in the text of files, and the module."""
    for module, path in _modules(package, files).items():
        yield from ((match[1], module) for match in re.finditer(pattern, path.read_text("utf-8"), re.MULTILINE))


def _modules(package: str, files: str) -> dict[str, Path]:
    """Return modules of a folder of mbdae by dotted name, except those with a leading underscore."""
    folder = PACKAGE.joinpath(*package.split(".")[1:])
    paths = sorted(path for path in folder.glob(files) if not path.stem.startswith("_"))
    return {".".join([package, *path.relative_to(folder).with_suffix("").parts]): path for path in paths}
