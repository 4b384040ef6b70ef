"""The back ends: is the compiled core there, may it be imported, and which one computes a run.

The core is linked to Pinocchio's library, whose name carries no version: loaded beside another Pinocchio than it was
built for, it crashes. So the versions are compared before it is imported.
"""

import platform
import re
import warnings
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from .errors import InputError, UnknownNameError

BACKENDS = ("auto", "native", "python")
SLOW = "mbdae computes in Python"  # how the warning begins
CORE = "mbdae._native"
BUILT_FOR = "_native_pinocchio.txt"  # written beside the core when it is built


def load() -> ModuleType | None:
    """Return the compiled core, or None where it is missing or was built for another Pinocchio."""
    return _core()[0]


def status() -> str:
    """Return one line: ``native (built for Pinocchio 4.1.0)``, or ``python: `` and the reason."""
    return _core()[1]


def machine() -> str:
    """Return what times were measured on: system, processor, version of Python."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = named[0] if named else platform.processor() or "unknown processor"
    return f"{platform.system()} {platform.machine()}, {processor}, Python {platform.python_version()}"


def known(backend: str) -> str:
    """Return the name of a back end.

    Raises:
        UnknownNameError: for another name.
    """
    if backend not in BACKENDS:
        raise UnknownNameError("backend", backend, BACKENDS)
    return backend


def choose(backend: str) -> ModuleType | None:
    """Return what computes a run: the compiled core, or None for Python.

    Args:
        backend: ``"auto"`` takes the core, or Python with one warning in each process; ``"native"`` insists on the
            core; ``"python"`` does without.

    Raises:
        UnknownNameError: for another name.
        InputError: ``"native"`` without a core that can be used; the message has the reason.
    """
    if known(backend) == "python":
        return None
    core = load()
    if core is None and backend == "native":
        raise InputError(f"backend='native' cannot be used, {status()}")
    if core is None:
        _warn()
    return core


@cache
def _warn() -> None:
    warnings.warn(f"{SLOW}, ten to forty times slower than with its compiled core; {status()}", stacklevel=6)


@cache
def _core() -> tuple[ModuleType | None, str]:
    spec = find_spec(CORE)
    if spec is None or spec.origin is None:
        return None, f"python: {_not_built(Path(__file__).parent)}"
    built = _built_for(Path(spec.origin).with_name(BUILT_FOR))
    found = _installed()  # imports Pinocchio, whose libraries the core then finds
    if built != found:
        return None, f"python: built for Pinocchio {built} but {found} is installed; install mbdae again"
    try:
        return import_module(CORE), f"native (built for Pinocchio {built})"
    except ImportError as e:
        return None, f"python: import failed: {' '.join(str(e).split())}"


def _not_built(package: Path) -> str:
    if (package / "native" / "CMakeLists.txt").is_file():
        return f"not built in {package}; install it with a C++17 compiler, or start from another folder"
    return "not built for this Python; install mbdae again with a C++17 compiler"


def _built_for(file: Path) -> str:
    try:
        found = file.read_text("ascii", errors="replace").strip().partition("\n")[0]
    except OSError:
        return f"unknown ({file.name} is missing)"
    if not found:
        return f"unknown ({file.name} is empty)"
    return found if re.fullmatch(r"[\w.+!-]{1,80}", found) else f"unknown ({file.name} holds no version)"


def _installed() -> str:
    """The exact version of Pinocchio, if the package that is imported and its library's are the same."""
    from importlib.metadata import PackageNotFoundError, version

    import pinocchio

    try:
        library = version("libpinocchio")
    except PackageNotFoundError:
        return f"{pinocchio.__version__} without the package libpinocchio"
    same = library.split(".")[:3] == pinocchio.__version__.split(".")[:3]  # a package may be built again: 4.1.0.1
    return library if same else f"{pinocchio.__version__} beside libpinocchio {library}"


def computed_by(backend: str, because: str) -> str:
    """Say it in words: the back end, and why not another one."""
    return f"{backend} back end ({because})" if because else f"{backend} back end"
