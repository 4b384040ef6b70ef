"""Samples of sub-commands that stand beside the tests of their studies."""

import ast
import re
from pathlib import Path


def found():
    """All ``COMMANDS = (...)`` of the tests of studies: what to run behind `mbdae run MODEL -o run.npz`."""
    texts = [path.read_text() for path in sorted((Path(__file__).parent / "studies").rglob("test_*.py"))]
    written = [re.search(r"^COMMANDS = (\(.*?\))$", text, re.M | re.S) for text in texts]
    return [command for some in written if some for command in ast.literal_eval(some[1])]
