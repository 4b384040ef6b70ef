"""The compiled core of an installed mbdae, for a source checkout without one.

Python started in a checkout imports its folder ``mbdae``, even if mbdae is installed. The installed core is used if it
was built from the same sources: their digest is written next to the core when it is built, by running this file as a
script: ``python installed_core.py mbdae/native _native_sources.txt``.
"""

import hashlib
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import distributions
from pathlib import Path

BUILT_FROM = "_native_sources.txt"  # written next to the core when it is built
SOURCES = ("CMakeLists.txt", "*/**/*.cpp", "*/**/*.hpp")


def digest(folder: Path) -> str:
    """Return the SHA-256 digest of names and contents of all sources of the core in a folder; platform-independent."""
    sha = hashlib.sha256()
    files = {path.relative_to(folder).as_posix(): path for pattern in SOURCES for path in folder.glob(pattern)}
    for name, path in sorted(files.items()):
        data = path.read_bytes()
        sha.update(f"{name} {len(data)}\n".encode())
        sha.update(data)
    return sha.hexdigest()


def find_installed(package: Path, name: str) -> tuple[Path | None, str]:
    """Find an installed core that was built from the sources of a checkout.

    Args:
        package: the folder ``mbdae`` of the checkout.
        name: name of the module of the core.

    Returns:
        The file of the core and an empty string; or None and the reason, which is empty if no core is installed, or if
        the folder has no sources to compare with.
    """
    sources = package / "native"
    if not (sources / "CMakeLists.txt").is_file():
        return None, ""
    folders = [Path(str(d.locate_file(package.name))).resolve() for d in distributions(name="mbdae")]
    cores = [f / f"{name}{suffix}" for f in folders if f != package.resolve() for suffix in EXTENSION_SUFFIXES]
    cores = [core for core in cores if core.is_file()]
    if not cores:
        return None, ""
    expected = digest(sources)
    for core in cores:
        if _built_from(core) == expected:
            return core, ""
    return None, f"the core in {cores[0].parent} is not built from the sources in {sources}; install mbdae again"


def _built_from(core: Path) -> str:
    try:
        return core.with_name(BUILT_FROM).read_text("ascii", errors="replace").strip()
    except OSError:
        return ""


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(f"{digest(Path(sys.argv[1]))}\n", "ascii")
