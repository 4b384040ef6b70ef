"""Structure: allowed imports, modules with heavy imports, and file lengths."""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "mbdae"
HOUSE = (
    "errors tolerances < system < mechanism methods textbook < solution < integrate < cli < studies"
    " < __init__ < __main__"
)
INSIDE = (
    "fmu tree time_functions < flexible < model_settings run_parameters < closures forces scene < assembly signals"
    " < formulations < equilibrium discrete_sensitivity < equations < mechanism < formats"
)
CORE = "math < mechanism < system < steps < run < sensitivity < bindings runtime"  # of native
SECRETS = {  # heavy or special imports, and the only modules that may use them
    "pinocchio": "mechanism/**/*.py backend.py",  # the latter compares versions
    "coal": "mechanism/**/*.py",
    "mujoco": "mechanism/formats/mjcf/*.py",
    "fmpy": "mechanism/fmu/*.py",
    "matplotlib": "studies/figures.py studies/*/figure.py",
    "meshcat": "",  # its viewer is a file
    "tornado": "studies/live/server.py",
    "umsgpack": "studies/replay/*.py studies/live/server.py",
    "click": "cli/*.py studies/*/command.py __main__.py",
    "rich": "cli/output.py progress.py",
    "jinja2": "studies/report/templates.py",
    "pyarrow": "studies/sweep/results_file.py",
}
FILES = sorted(PACKAGE.rglob("*.py"))


@cache
def tree_of(path):
    return ast.parse(path.read_text())


@cache
def imported(path):
    """Full names of everything a file imports, wherever in it, except for type checkers."""
    nodes, names = list(ast.walk(tree_of(path))), []
    package = ["mbdae", *path.relative_to(PACKAGE).parts[:-1]]
    skipped = {
        id(inner)
        for node in nodes
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in nodes:
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = [*base, *([node.module] if node.module else [])]
            names += [".".join([*stem, alias.name]) for alias in node.names]
    return names


@cache
def room(name, folder=PACKAGE):
    """The folder entry of a module given by its dotted name: the first file or folder in it, or the folder itself."""
    depth = len(folder.relative_to(ROOT).parts)
    first = name.split(".")[depth] if name.count(".") >= depth else ""
    exists = (folder / first).is_dir() or (folder / f"{first}.py").is_file()
    return first if first and exists else "__init__"


def floor(name, order):
    """Level of an entry in an order of them; None for those not listed."""
    return next((level for level, names in enumerate(order.split(" < ")) if name in names.split()), None)


@cache
def home(name):
    """The folder of a module given by its dotted name, or the module itself where folders are next to it."""
    parts = name.split(".")
    while not (file := ROOT.joinpath(*parts).with_suffix(".py")).is_file():
        if (folder := ROOT.joinpath(*parts)).is_dir():
            file = folder / "__init__.py"
            break
        parts.pop()
    beside = any(path.is_dir() and any(path.glob("*.py")) for path in file.parent.iterdir())
    return str((file if beside else file.parent).relative_to(ROOT))


def dotted(path):
    return ".".join(["mbdae", *path.relative_to(PACKAGE).with_suffix("").parts])


def imports_upwards(path):
    """Imports of a file from its own level of an order, or from one above."""
    for folder, order in ((PACKAGE, HOUSE), (PACKAGE / "mechanism", INSIDE)):
        inside = ".".join(folder.relative_to(ROOT).parts) + "."
        here = room(dotted(path), folder)
        level = floor(here, order) if dotted(path).startswith(inside) else None
        for name in imported(path) if level is not None else ():
            there = room(name, folder) if name.startswith(inside) else here
            below = floor(there, order)
            if there != here and below is not None and below >= level:
                yield f"{path.relative_to(PACKAGE)} ({here}) imports {name} ({there})"


def test_imports_go_down():
    assert not [said for path in FILES for said in imports_upwards(path)]


def test_includes_of_the_core_go_down():
    for path in sorted((PACKAGE / "native").rglob("*.[ch]pp")):
        here = path.relative_to(PACKAGE / "native").parts[0]
        for name in re.findall(r'#include "(\w+)/', path.read_text()):
            assert name == here or floor(name, CORE) < floor(here, CORE), f"{path.name} ({here}) includes from {name}"


def circle(graph):
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as e:
        return e.args[1]
    return None


def test_no_circle_of_folders():
    graph = {}
    for path in FILES:
        here = home(dotted(path))
        found = {home(name) for name in imported(path) if name.split(".")[0] == "mbdae"}
        graph.setdefault(here, set()).update(found - {here})
    assert circle(graph) is None
    assert circle({**graph, "mbdae/errors.py": {"mbdae/mechanism/mechanism.py"}})


def test_the_test_sees_imports():
    # checks the analysis itself: relative, nested and plain imports are found, those for type checkers are not
    found = set(imported(PACKAGE / "mechanism" / "formulations" / "index2.py"))
    assert {"numpy", "mbdae.errors.StepError", "mbdae.system.System"} <= found
    assert not any("mechanism.mechanism" in name for name in found)
    assert floor("methods", HOUSE) == floor("mechanism", HOUSE) < floor("integrate", HOUSE)
    assert home("mbdae.mechanism.scene.shapes.Shape") == "mbdae/mechanism/scene"
    assert home("mbdae.mechanism.mechanism.Mechanism") == "mbdae/mechanism/mechanism.py"
    assert room("mbdae.mechanism.tree.frames.Pair") == "mechanism"
    assert room("mbdae.load") == "__init__"


@pytest.mark.parametrize("secret", SECRETS)
def test_heavy_imports_are_confined_to_one_module(secret):
    users = {p for p in FILES if secret in {name.split(".")[0] for name in imported(p)}}
    assert users <= {p for place in SECRETS[secret].split() for p in PACKAGE.glob(place)}


def test_the_core_is_imported_behind_its_guard():
    assert not [p.name for p in FILES if any(name.startswith("mbdae._native") for name in imported(p))]
    assert not [p.name for p in FILES if p.name != "backend.py" and '_native"' in p.read_text()]


def test_methods_know_numbers_only():
    allowed = {"numpy", "scipy", "mbdae", *sys.stdlib_module_names}
    for path in PACKAGE.glob("methods/**/*.py"):
        assert {name.split(".")[0] for name in imported(path)} <= allowed, path.name


def test_importing_mbdae_stays_light():
    code = "import sys, mbdae; print(*{name.split('.')[0] for name in sys.modules})"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not {*SECRETS, "numpy", "scipy", "pydantic", "tornado", "pytest"} & set(out.stdout.split())


@pytest.mark.parametrize("folder", ["mbdae", "tests", "examples"])
def test_files_are_short(folder):
    long = {str(p): n for p in (ROOT / folder).rglob("*.py") if (n := len(p.read_text().splitlines())) > 300}
    assert not long


def test_each_name_has_one_meaning():
    """No class is defined twice, and arrays have one short name."""
    places = defaultdict(list)
    for path in FILES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(path.name)
            elif isinstance(node, ast.Assign) and ast.unparse(node.value) in ("np.ndarray", "numpy.ndarray"):
                places["Array"].append(path.name)
    assert places["Array"] == ["system.py"]
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_every_public_name_is_documented():
    import mbdae

    for name in mbdae.__all__:
        value = getattr(mbdae, name)
        assert isinstance(value, dict) or (value.__doc__ or "").strip(), name
