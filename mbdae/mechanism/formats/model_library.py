"""Where files are: the models that come with mbdae, and robots of other packages."""

import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

from ...discovery import LIBRARY_FILES, model_names, models_directory, plugins
from ...errors import InputError, UnknownNameError, require

ROBOTS, DESCRIPTIONS = "example-robot-data:", "robot_descriptions"
MECHANISM, PARAMETRIC = ".toml", ".py"
SOURCES = (".urdf", ".xml", ".mjcf", ".sdf", ".yaml")
READERS: dict[str, Callable[[Path], str]] = {  # of installed packages: suffix, and what a mechanism file would say
    f".{name}": reader
    for name, reader in plugins("mbdae.readers", callable, "a function of a path").items()
    if f".{name}" not in (MECHANISM, PARAMETRIC, *SOURCES)
}
SUFFIXES = ", ".join((MECHANISM, PARAMETRIC, *SOURCES[:-1])) + f" or {SOURCES[-1]}"
IN_FOLDER = (*LIBRARY_FILES, "robot.yaml", "robot.urdf")


def find(name: str) -> Path:
    """Return the file that a model's name or a path stands for.

    Raises:
        UnknownNameError: when it is neither.
        InputError: for a file of a kind that is not read.
    """
    if name.startswith(ROBOTS):
        return resolve(name, Path())
    path = models_directory() / name if name in model_names() else Path(name)
    try:
        if path.is_dir():
            path = next((path / n for n in IN_FOLDER if (path / n).is_file()), path)
        found = path.is_file()
    except (OSError, ValueError) as e:
        raise InputError(f"{name[:80]!r} is not a path: {e}") from None
    if not found and (described := _described(name)):
        path, found = described, True
    if not found:
        if path.suffix:
            raise InputError(f"no such file: {name}")
        raise UnknownNameError("model", name, [*model_names(), f"a path to a {SUFFIXES} file or their folder"])
    refuse_suffix(path)
    return path


def _described(name: str) -> Path | None:
    """The URDF or MJCF file of a name of robot_descriptions, ``"panda_description"``, where that is installed.

    Raises:
        InputError: for a description that cannot be had: the package fetches it when it is first used.
    """
    if not name.isidentifier() or not name.endswith("_description") or find_spec(DESCRIPTIONS) is None:
        return None
    if find_spec(f"{DESCRIPTIONS}.{name}") is None:
        return None
    try:
        module = import_module(f"{DESCRIPTIONS}.{name}")
    except Exception as e:
        raise InputError(f"{DESCRIPTIONS} has {name!r}, but cannot fetch it: {' '.join(str(e).split())}") from None
    files = [getattr(module, key, None) for key in ("URDF_PATH", "MJCF_PATH")]
    found = next((Path(file) for file in files if file), None)
    if found is None or not found.is_file():
        raise InputError(f"{DESCRIPTIONS} has {name!r} without a URDF or MJCF file")
    return found


def refuse_suffix(path: Path) -> None:
    """Refuse a file that is not read.

    Raises:
        InputError: lists what is.
    """
    if path.suffix not in (MECHANISM, PARAMETRIC, *SOURCES, *READERS):
        raise InputError(f"cannot read {path.name}: expected a {SUFFIXES} file")


def resolve(source: str, base: Path) -> Path:
    """Return the path of a mechanism file's source, relative to ``base`` or in example-robot-data.

    Raises:
        InputError: if there is no such file.
    """
    path = robots_directory() / source.removeprefix(ROBOTS) if source.startswith(ROBOTS) else base / source
    try:
        found = path.is_file()
    except (OSError, ValueError) as e:
        raise InputError(f"source {source[:80]!r} is not a path: {e}") from None
    if not found:
        raise InputError(f"source {source!r} is not a file (looked at {path})")
    return path


def installed() -> list[Path]:
    """The folders of installed packages, of mbdae's models and of example-robot-data."""
    packages = [Path(p).resolve() for p in sys.path if Path(p).name in ("site-packages", "dist-packages")]
    with suppress(InputError):
        packages.append(robots_directory().resolve())
    return [*packages, models_directory().resolve()]


def robots_directory() -> Path:
    """The folder of robot descriptions that example-robot-data installs."""
    try:
        files = distribution("example-robot-data").files or []
    except PackageNotFoundError:
        raise InputError("example-robot-data is not installed") from None
    found = next((f for f in files if f.suffix == ".urdf" and "robots" in f.parts), None)
    if found is None:
        raise InputError("example-robot-data is installed without robots")
    up = len(found.parts) - found.parts.index("robots") - 1
    return Path(str(found.locate())).parents[up - 1]


def told(found: Path) -> str:
    """What a mechanism file would say, from the reader of an installed package.

    Raises:
        InputError: where the reader fails, or returns no text.
    """
    try:
        text = READERS[found.suffix](found)
    except Exception as e:  # of another package
        raise InputError(f"the reader of {found.suffix} files fails on {found}: {type(e).__name__}: {e}") from e
    require(text, str, f"the reader of {found.suffix} files returns the text of a mechanism file")
    return text
