"""Cyclomatic complexity of functions, as radon counts it: conditions, loops, comprehensions and boolean operators.

The limits fall with the code, to 20 for each function and 15 functions above 15; they never rise.
"""

from functools import cache
from pathlib import Path

import pytest

radon = pytest.importorskip("radon.complexity")
visitors = pytest.importorskip("radon.visitors")

PACKAGE = Path(__file__).parents[1] / "mbdae"
CLEAR = 15  # above it a function is hard to follow
LARGEST = {"": 20, "integrate": 63, "mechanism": 52}  # by folder
MOST_UNCLEAR = 28
CUT = ("cli", "studies", "solution", "textbook", "methods")  # where no function is above CLEAR


@cache
def complexities():
    """Complexity of each function and method, by file and name."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        for block in radon.cc_visit(path.read_text("utf-8")):
            if isinstance(block, visitors.Function):
                name = f"{path.relative_to(PACKAGE).as_posix()}: {block.fullname}"
                found[name] = block.complexity
    return found


def folder(name):
    return name.partition("/")[0]


def test_no_function_is_above_the_limit_of_its_folder():
    limits = {name: LARGEST.get(folder(name), LARGEST[""]) for name in complexities()}
    assert not {name: x for name, x in complexities().items() if x > limits[name]}


def test_few_functions_are_hard_to_follow():
    unclear = {name: x for name, x in complexities().items() if x > CLEAR}
    assert len(unclear) <= MOST_UNCLEAR, unclear
    assert not [name for name in unclear if folder(name) in CUT]
