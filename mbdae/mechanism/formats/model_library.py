"""Locations of model files: models of mbdae, and robots of other packages."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from ...discovery import LIBRARY_FILES, is_model_name, model_names, models_directory, robots_directory
from ...errors import InputError, UnknownNameError
from .readers import CONVERTERS, MECHANISM, PARAMETRIC, SOURCES

ROBOTS, DESCRIPTIONS = "example-robot-data:", "robot_descriptions"
SUFFIXES = ", ".join((MECHANISM, PARAMETRIC, *SOURCES[:-1])) + f" or {SOURCES[-1]}"
IN_FOLDER = (*LIBRARY_FILES, "robot.yaml", "robot.urdf")


def find(name: str) -> Path:
    """Return the file for the name of a model or a path.

    Raises:
        UnknownNameError: if it is neither.
        InputError: for an unsupported kind of file.
    """
    if name.startswith(ROBOTS):
        return resolve(name, Path())
    path = models_directory() / name if is_model_name(name) else Path(name)
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
    require_supported_suffix(path)
    return path


def _described(name: str) -> Path | None:
    """Return the URDF or MJCF file of robot_descriptions, ``"panda_description"``, if that is installed.

    Raises:
        InputError: for an unavailable description, which the package downloads on first use.
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


def require_supported_suffix(path: Path) -> None:
    """Reject unsupported kinds of files.

    Raises:
        InputError: for an unsupported kind; lists the supported kinds.
    """
    if path.suffix not in (MECHANISM, PARAMETRIC, *SOURCES, *CONVERTERS):
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
        raise InputError(f"source {source!r} is not a file (tried {path})")
    return path
