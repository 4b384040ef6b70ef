"""Type stub of the compiled core for type checkers: the stub by nanobind, in a shorter form.

The file is in the repository, so that type checkers need no core. Rewrite it, with nanobind installed, by

    python tests/native_stub.py
"""

import re
import subprocess
import sys
from pathlib import Path

import mbdae
from mbdae import backend

STUB = Path(mbdae.__file__).parent / "_native.pyi"
HEADER = '''\
"""The compiled core for type checkers; tests/native_stub.py writes this file. Fields: native/*/*.hpp."""

from collections.abc import Sequence
from typing import Any, overload

import numpy as np

Array = np.ndarray

'''
ATTRIBUTE = r"    @property\n    def (\w+)\(self\) -> (.*): \.\.\.\n\n    @\1\.setter\n    def \1\(.*\n\n?"


def stub() -> str:
    """Return the text of the file."""
    from nanobind.stubgen import StubGen

    generator = StubGen(backend.load(), include_docstrings=False)
    generator.put(backend.load())
    text = re.sub(r"Annotated\[NDArray\[numpy\.float64\](?:, dict\([^()]*\))?\]", "Array", generator.get())
    text = re.sub(r"Annotated\[NDArray\[\w+\.\w+\], dict\([^()]*\)\]|NDArray\[numpy\.float64\]", "Array", text)
    text = re.sub(r"\bobject\b", "Any", re.sub(ATTRIBUTE, r"    \1: \2\n", text))
    text = HEADER + text.partition("\n\n\n")[2]
    command = [sys.executable, "-m", "ruff", "format", "--line-length", "120", "--stdin-filename", str(STUB), "-"]
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


if __name__ == "__main__":
    STUB.write_text(stub(), "utf-8")
