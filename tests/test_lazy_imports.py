"""Functions that are imported when called exist."""

import re
from importlib import import_module
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "mbdae"
CALL = re.compile(r'lazy_import\(\s*"([\w.]+)",\s*"(\w+)"')
TARGETS = sorted({found for path in FOLDER.rglob("*.py") for found in CALL.findall(path.read_text("utf-8"))})


@pytest.mark.parametrize(("module", "name"), TARGETS)
def test_target_exists(module, name):
    assert callable(getattr(import_module(module), name))


def test_there_are_targets():
    assert len(TARGETS) > 10
