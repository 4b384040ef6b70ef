"""Provenance of a result: versions of packages, and the command."""

import shlex
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

version_of = cache(version)  # reading the metadata of a package takes as long as saving a short run


def versions() -> dict[str, str]:
    """Return versions of mbdae and of the numerical packages."""
    return {name: version_of(name) for name in ("mbdae", "pin", "numpy", "scipy")}


def command_line() -> str:
    """Return the command line, quoted for a shell."""
    program = Path(sys.argv[0]).name
    return shlex.join(["mbdae" if program == "__main__.py" else program, *sys.argv[1:]])
