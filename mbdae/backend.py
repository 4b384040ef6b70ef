"""Back ends: availability of the compiled core, and selection of the back end of a run.

The core is linked to Pinocchio's library, whose file name contains no version: the core crashes with any version other
than the one it was built for. The versions are therefore compared before the import. A source checkout without a core
uses the core of an installed mbdae, if both have the same sources (`mbdae.installed_core`).
"""

import platform
import re
import sys
import warnings
from functools import cache
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from threading import Lock
from types import ModuleType

from .errors import InputError, UnknownNameError

BACKENDS = ("auto", "native", "python")
SLOW_WARNING = "mbdae computes in Python"  # beginning of the warning
CORE = "mbdae._native"
BUILT_FOR = "_native_pinocchio.txt"  # written next to the core when it is built
IMPORT_LOCK = Lock()  # the first runs of a worker may start in several threads


def load() -> ModuleType | None:
    """Return the compiled core; None if it is missing or was built for another version of Pinocchio."""
    return _core()[0]


def status() -> str:
    """Return one line of text: ``native (built for Pinocchio 4.1.0)``, or ``python: `` and the reason."""
    return _core()[1]


def machine_description() -> str:
    """Return a description of the machine, for timings: operating system, processor, version of Python."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = models[0] if models else platform.processor() or "unknown processor"
    return f"{platform.system()} {platform.machine()}, {processor}, Python {platform.python_version()}"


def checked_backend(backend: str) -> str:
    """Check the name of a back end, and return it.

    Raises:
        UnknownNameError: for an unknown name.
    """
    if backend not in BACKENDS:
        raise UnknownNameError("backend", backend, BACKENDS)
    return backend


def select_core(backend: str) -> ModuleType | None:
    """Return the compiled core, or None for the Python back end.

    Args:
        backend: ``"auto"`` uses the core, or Python with one warning per process; ``"native"`` requires the core;
            ``"python"`` does not use it.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for ``"native"`` without a usable core; the message contains the reason.
    """
    if checked_backend(backend) == "python":
        return None
    core = load()
    if core is None and backend == "native":
        raise InputError(f"backend='native' cannot be used, {status()}")
    if core is None:
        _warn()
    return core


@cache
def _warn() -> None:
    warnings.warn(f"{SLOW_WARNING}, ten to forty times slower than with its compiled core; {status()}", stacklevel=6)


@cache
def _core() -> tuple[ModuleType | None, str]:
    package, spec, location = Path(__file__).parent, find_spec(CORE), ""
    path = Path(spec.origin) if spec and spec.origin else None
    if path is None:  # a source checkout: use the core of the installed mbdae
        from .installed_core import find_installed

        path, reason = find_installed(package, CORE.rpartition(".")[2])
        if path is None:
            return None, f"python: {reason or _not_built(package)}"
        location = f", installed in {path.parent}"
    required = _built_for(path.with_name(BUILT_FOR))
    installed = _installed()  # imports Pinocchio, which loads the libraries that the core needs
    if required != installed:
        return None, f"python: built for Pinocchio {required} but {installed} is installed; install mbdae again"
    try:
        return _imported(path), f"native (built for Pinocchio {required}{location})"
    except ImportError as e:
        return None, f"python: import failed: {' '.join(str(e).split())}"


def _imported(path: Path) -> ModuleType:
    """Import the core from a file in any folder, under its usual module name; once per process, like any import."""
    with IMPORT_LOCK:
        if CORE in sys.modules:
            return sys.modules[CORE]
        spec = spec_from_file_location(CORE, path)
        if spec is None or spec.loader is None:
            raise ImportError(f"{path} is not a module")
        sys.modules[CORE] = module = module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[CORE]
            raise
        return module


def _not_built(package: Path) -> str:
    if (package / "native" / "CMakeLists.txt").is_file():
        return f"not built in {package}; no core is installed: run `pip install .` with a C++17 compiler"
    return "not built for this Python; install mbdae again with a C++17 compiler"


def _built_for(file: Path) -> str:
    try:
        version = file.read_text("ascii", errors="replace").strip().partition("\n")[0]
    except OSError:
        return f"unknown ({file.name} is missing)"
    if not version:
        return f"unknown ({file.name} is empty)"
    return version if re.fullmatch(r"[\w.+!-]{1,80}", version) else f"unknown ({file.name} contains no version)"


def _installed() -> str:
    """Return the exact version of Pinocchio; of both, if the imported package and its library differ."""
    from importlib.metadata import PackageNotFoundError, version

    import pinocchio

    try:
        library = version("libpinocchio")
    except PackageNotFoundError:
        return f"{pinocchio.__version__} without the package libpinocchio"
    same_version = library.split(".")[:3] == pinocchio.__version__.split(".")[:3]  # a package may be rebuilt: 4.1.0.1
    return library if same_version else f"{pinocchio.__version__} with libpinocchio {library}"


def describe_backend(backend: str, reason: str) -> str:
    """Return a description of a back end, with the reason for not using the other one."""
    return f"{backend} back end ({reason})" if reason else f"{backend} back end"
