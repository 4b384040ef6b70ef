"""No threshold of the compiled core is a literal: all are defined in Python."""

import re
from pathlib import Path

NATIVE = Path(__file__).parents[2] / "mbdae" / "native"
SOURCES = sorted([*NATIVE.rglob("*.cpp"), *NATIVE.rglob("*.hpp")])
EXACT = {0.0, 0.5, 1.0, 2.0}  # in formulas
LARGEST_INTEGER = 9  # of indices and sizes of vectors and matrices in space
SIZES = {12, 20, 36, 50, 1000000}
"""Of a bushing, terms of a series, of a matrix (6, 6), microseconds between checks of a lock, states in memory."""
NOT_NUMBERS = re.compile(r'//[^\n]*|"[^"\n]*"|^#[^\n]*', re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[uUlLfF]*\b\.?")


def literals(text):
    """Numbers in C++ other than exact ones and small integers."""
    for found in NUMBER.findall(NOT_NUMBERS.sub("", text)):
        value = float(found.rstrip("uUlLfF"))
        if re.fullmatch(r"\d+", found):
            if value > LARGEST_INTEGER and value not in SIZES:
                yield found
        elif value not in EXACT:
            yield found


def test_no_threshold_is_a_literal():
    assert not {path.name: found for path in SOURCES if (found := list(literals(path.read_text())))}


def test_the_test_sees_literals():
    text = 'x < 1e-3; y * 0.25f + .75; z(3.); n = 32u; // 0.1\n"0.2" a1e5 b[36] * 0.5 + 2.0 * w3.x + 1 / 6'
    assert list(literals(text)) == ["1e-3", "0.25f", ".75", "3.", "32u"]
