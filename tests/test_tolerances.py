"""Small numbers: `mbdae/tolerances.py` has all that decide something, in Python and in the core."""

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "mbdae"
TABLE = PACKAGE / "tolerances.py"
DATA = PACKAGE / "textbook" / "problems" / "driven_circuit.py"  # numbers of a circuit
FILES = [p for p in sorted(PACKAGE.rglob("*.py")) if p not in (TABLE, DATA)]
CORE = sorted((PACKAGE / "native").rglob("*.[ch]pp"))
MOST = 40
SMALL, PLAIN = 1e-2, 1e-3  # numbers below are tolerances: in exponent notation, and as decimals such as 0.006
# widths of difference quotients and smallest steps, and the accuracy of results that users ask for
NO_TOLERANCE = re.compile("(^|_)(WIDTHS?|STEP|SPACING|DEFAULTS?|TOLERANCES)$")
NUMBER = re.compile(r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[fFlL]?(?![\w.])|\bepsilon\s*\(")
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"", re.S)


def exempt(tree):
    """Nodes of default arguments, and of constants whose names say that they are no tolerances."""
    for node in ast.walk(tree):
        if isinstance(node, ast.arguments):
            yield from (x for x in (*node.defaults, *node.kw_defaults) if x is not None)
        elif isinstance(node, ast.ClassDef):
            yield from (x.value for x in node.body if isinstance(x, ast.AnnAssign) and x.value is not None)
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            names = [x.id for x in ast.walk(node) if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store)]
            if node.value is not None and any(map(NO_TOLERANCE.search, names)):
                yield node.value


def small_numbers(text):
    """Lines of a module with numbers that can only be tolerances."""
    tree = ast.parse(text)
    skipped = {id(inner) for node in exempt(tree) for inner in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and 0 < node.value < SMALL:
            if node.value < PLAIN or "e" in ast.get_source_segment(text, node).lower():
                yield f"{node.lineno}: {node.value}"
        elif isinstance(node, ast.BinOp) and re.fullmatch(r"10(\.0)? \*\* \(?-\d+\)?", ast.unparse(node)):
            yield f"{node.lineno}: {ast.unparse(node)}"


def small_numbers_of_core(text):
    code = COMMENT.sub(" ", text)
    return [x for x in NUMBER.findall(code) if "(" in x or 0 < float(x.rstrip("fFlL")) < SMALL]


def files_with(numbers, paths):
    """Lines or numbers that a scan finds, by file."""
    found = {path.relative_to(PACKAGE).as_posix(): list(numbers(path.read_text("utf-8"))) for path in paths}
    return {path: said for path, said in found.items() if said}


def test_python_decides_by_the_table():
    assert files_with(small_numbers, FILES) == {}


def test_the_core_receives_its_tolerances():
    assert files_with(small_numbers_of_core, CORE) == {}


def test_the_table_is_short_explained_and_used():
    text = TABLE.read_text("utf-8")
    names = [x.targets[0].id for x in ast.parse(text).body if isinstance(x, ast.Assign)]
    assert len(set(names)) == len(names) <= MOST
    for name in names:
        scale = re.search(rf"^{name} = \S+  # (relative to|absolute|multiple of|level of|in|rad|s:)", text, re.M)
        assert scale, f"{name} has no scale"
    used = set(re.findall(r"\b[A-Z_]+\b", " ".join(p.read_text("utf-8") for p in FILES)))
    assert set(names) <= used


@pytest.mark.parametrize("code", ["x < 1e-9", "A = 2e-3", "f(rtol=1e-6)", "y = 3 * 1e-7", "B, C = 1, 0.0001", "10**-9"])
def test_the_scan_sees_tolerances(code):
    assert list(small_numbers(code))


@pytest.mark.parametrize("code", ["x < 1e3", "WIDTH = 1e-3", "def f(rtol=1e-6): pass", "size = 0.006 * length", "1e-2"])
def test_the_scan_leaves_other_numbers(code):
    assert not list(small_numbers(code))


def test_the_scan_of_the_core():
    assert small_numbers_of_core("if (x < 1e-9) return; // 1e-8") == ["1e-9"]
    assert small_numbers_of_core("x < 4 * std::numeric_limits<double>::epsilon()")
    assert not small_numbers_of_core('throw Error("1e-9"); v[1] = 0.5 * a.b1 + 1e3;')
