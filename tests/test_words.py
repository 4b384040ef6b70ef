"""Terminology: old words must not return to names and prose.

`.github/GLOSSARY.md` lists old words and the terms that replace them.
"""

import ast
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TRACKED = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True).stdout.split()
FILES = [ROOT / x for x in TRACKED] if TRACKED else [x for x in ROOT.rglob("*") if ".venv" not in x.parts]
PART = re.compile(
    "slopes?|turning|rising|settled?|settles|strikes?|struck|blows?|rubs?|rubbing|leaps?|leapt|looks?|looked|stands?|"
    "standstill|stuff|things?|doubts?|doubtful|departed|blamed?|told|anew|afresh|retraced?|remembered|troubled?|"
    "estranged|suspect|landed|landing|gaping|halted|freedoms?|untold"
)
WHOLE = re.compile(
    "plain|parts?|pieces?|places?|ends|way|ways|same|near|exactly|half|back|whole|share|shares|head|met|meet|keep|fits|"
    "refuse|acts|lost|felt|asked|own|usual|many|least|kept|cut|grips|slides|bears|touches|turns|walk|trace|hold|held|"
    "words|numbers"
)
PROSE = re.compile(
    r"\b(?:slopes?|blows?|leaps?|leapt|rubs?|rubbing|stuff|doubts?|anew|afresh|hitherto)\b"
    r"|(?<![Dd]egree of )(?<![Dd]egrees of )\bfreedoms?\b"
    r"|\b(?:[Ll]ooks?|looked) (?:at|for|ahead|after|back)\b"
    r"|\b(?:stands?|stood) (?:at|there|in|behind|beside|still|for|open)\b"
    r"|\b(?:is|are) (?:told|asked|struck|found anew|once more)\b"
    r"|\b(?:his|her|one's) own\b|\bof (?:one's|its|their) own\b|\bbut for\b"
    r"|\b(?:[Pp]artials?|[Dd]erivatives?) (?:[^.;:]* )?by (?:\(|(?:[a-z]|lam)\b(?! [a-z]))"
    r"|\b(?:shall|likewise|alike|thither|whereto)\b|\bcarr(?:y|ies) (?:no |a |the )?load\b"
)
PROSE_OF_PYTHON = re.compile(PROSE.pattern + r"|(?:^|[.:;] )[Ww]hat (?!if\b)\w+")
STAYING = {  # names that stay, by folder or file
    "order": ("fit_slope",),  # of a line fitted to errors over step sizes
    "kinematics": ("rising",),  # attribute and JSON key of assembly modes
}
FITTED = ("order", "benchmarks", "report")  # folders whose slopes are those of fitted lines
PAGE_ON_ORDERS = "check.md"
OF_TESTS = re.compile("slopes?|doubtful|freedoms?")  # of fitted lines, a status, degrees of freedom


@cache
def words(name):
    return [x.lower() for x in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", name)]


def sources(*suffixes):
    return [p for p in FILES if p.suffix in suffixes and p.name != "test_words.py" and p.is_file()]


def package():
    return [p for p in sources(".py") if "mbdae" in p.relative_to(ROOT).parts[:1]]


@cache
def nodes(path):
    """The nodes of a file that are read here: definitions, arguments, variables, texts and expressions of one text."""
    kinds = (ast.FunctionDef, ast.ClassDef, ast.arg, ast.Name, ast.Constant, ast.Expr)
    return [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, kinds)]


@cache
def defined(path):
    """Names that a module defines: of functions, classes, arguments, variables."""
    found = []
    for node in nodes(path):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.append(node.name)
        elif isinstance(node, ast.arg):
            found.append(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.append(node.id)
    return found


def comments_and_docstrings(path):
    """Prose of a file, each docstring (of attributes, too) and each line of a comment as one line."""
    for node in nodes(path):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield " ".join(node.value.value.split())
    yield from re.findall(r"#\s+(.*)$", path.read_text("utf-8"), re.M)


def stays(path, name):
    return any(name in STAYING.get(part, ()) for part in path.parts)


def found_names():
    found = ((p, n) for p in package() for n in defined(p) if any(PART.fullmatch(w) for w in words(n)))
    return [f"{p.name}: {n}" for p, n in found if not stays(p, n)]


def found_loads():
    """Loads are applied: rows have multipliers, contacts normal forces, limits an utilization."""
    files = (p for p in package() if {"hybrid", "events", "discrete_sensitivity"} & {*p.parts})
    return [f"{p.name}: {n}" for p in files for n in defined(p) if {"load", "loads", "loaded"} & {*words(n)}]


def found_in_tests():
    """Old words in names of tests and examples, and of their files."""
    others = {*sources(".py")} - {*package()}
    found = ((p, n) for p in others for n in {p.stem, *defined(p)})
    return [
        f"{p.name}: {n}"
        for p, n in found
        if any(PART.fullmatch(w) and not OF_TESTS.fullmatch(w) for w in words(n)) and not stays(p, n)
    ]


def found_members():
    return [
        f"{p.name}: {n.name}"
        for p in package()
        for n in nodes(p)
        if isinstance(n, ast.FunctionDef | ast.ClassDef) and WHOLE.fullmatch(n.name)
    ] + [p.name for p in package() if WHOLE.fullmatch(p.stem)]


def found_in_python():
    """Old words in docstrings and comments; a fitted line has a slope."""
    found = [(p, w) for p in sources(".py") for x in comments_and_docstrings(p) for w in PROSE_OF_PYTHON.findall(x)]
    return [f"{p.name}: {w}" for p, w in found if not (w.startswith("slope") and p.parent.name in FITTED)]


def found_messages():
    """Old words in texts that users see: all but docstrings."""
    found = []
    for p in package():
        docs = {id(n.value) for n in nodes(p) if isinstance(n, ast.Expr)}
        texts = [n.value for n in nodes(p) if isinstance(n, ast.Constant) and id(n) not in docs]
        found += [(p, w) for x in texts if isinstance(x, str) for w in PROSE.findall(x)]
    return [f"{p.name}: {w}" for p, w in found if not (w.startswith("slope") and p.parent.name in FITTED)]


def identifiers(path):
    """Identifiers of a C++ file, without its comments, texts, included files, and ``back`` of a vector."""
    text = re.sub(r"//.*$|#include .*$", "", path.read_text("utf-8"), flags=re.M)
    return set(re.findall(r"[A-Za-z_]\w*", re.sub(r'"(?:\\.|[^"\\])*"|\.back\(\)', "", text)))


def found_constants():
    """Comments of constants that begin with "of": the noun, a fraction or a number, is missing."""
    lines = [(p, x) for p in package() for x in p.read_text("utf-8").splitlines()]
    return [f"{p.name}: {x}" for p, x in lines if re.match(r"[A-Z_][A-Z0-9_, ]*[:=].*#\s+of\b", x)]


def found_identifiers():
    """Old words within identifiers of the core, and as members, functions and fields that its headers declare."""
    found = [(p, n) for p in sources(".cpp", ".hpp") for n in identifiers(p)]
    return [
        f"{p.name}: {n}"
        for p, n in found
        if any(PART.fullmatch(w) for w in words(n))
        or (WHOLE.fullmatch(n.strip("_")) and (p.suffix == ".hpp" or n.endswith("_")))
    ]


def found_in_core():
    texts = ((p, re.findall(r"//.*$", p.read_text("utf-8"), re.M)) for p in sources(".cpp", ".hpp"))
    return [f"{p.name}: {w}" for p, lines in texts for x in lines for w in PROSE.findall(x)]


def found_in_pages():
    found = [(p, w) for p in sources(".md") if p.name != "GLOSSARY.md" for w in PROSE.findall(p.read_text("utf-8"))]
    return [f"{p.name}: {w}" for p, w in found if not (w.startswith("slope") and p.name == PAGE_ON_ORDERS)]


FOUND = {
    "names": found_names,
    "loads of switches": found_loads,
    "names of tests": found_in_tests,
    "members": found_members,
    "messages": found_messages,
    "constants": found_constants,
    "identifiers of C++": found_identifiers,
    "prose of Python": found_in_python,
    "prose of C++": found_in_core,
    "pages": found_in_pages,
}


@pytest.mark.parametrize("where", FOUND)
def test_no_old_words(where):
    assert not FOUND[where]()


@pytest.mark.parametrize("names", STAYING)
def test_names_that_stay_exist(names):
    used = {n for p in package() if names in p.parts for n in defined(p)}
    assert used >= {*STAYING[names]}
