"""The examples of CONTRIBUTING, taken literally: each is the file that its section says, in a copy of the package."""

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / ".github" / "CONTRIBUTING.md").read_text("utf-8")
FILES = {
    "ralston2": "methods/ralston2.py",
    "JointDrag": "mechanism/forces/joint_drag.py",
    "PlanarClosure": "mechanism/closures/kinds/planar.py",
    "AroundClosure": "mechanism/closures/kinds/around.py",
    "travels": "solution/travel.py",
    "chain": "mechanism/formats/chain.py",
    "top_speed": "studies/top_speed/top_speed.py",
}
LISTS = {
    "solution/signals.py": ("travel_units, travels", "SignalGroup(travel_units, travels)"),
    "integrate/trajectory/column_derivatives.py": (
        "travel_units, travel_derivatives",
        "DerivativeGroup(travel_units, travel_derivatives, needs_rates=False)",
    ),
}
PROGRAM = """
import numpy as np
import mbdae

def run(kind, factor):
    moments = [0.1, 0.1, 0.1, 0, 0, 0]
    arm = {"name": "arm", "parent": "world", "axis": [0, 1, 0], "mass": 2.0, "com": [0.5, 0, 0], "inertia": moments}
    law = {"kind": f"joint_{kind}", "name": "air", "joint": "arm", kind: factor}
    tables = {"body": [arm], "force": [law], "start": {"q": {"arm": -0.3}}}
    return mbdae.solve(mbdae.load(tables), (0, 0.2), method="ralston2", step=1e-3)


sol, h = run("drag", 0.3), 1e-4
work = sol.signals("work.air")["work.air"][-1]
assert np.isclose(work, -0.3 * np.trapezoid(np.abs(sol.v[:, 0]) ** 3, sol.t), rtol=1e-3)
assert np.isclose(mbdae.top_speed(sol), np.abs(sol.v).max())
assert mbdae.Closure.planar("a", "b").m == 3 and mbdae.Closure.around("a", "b", 0.3).m == 1
open("rods.chain", "w").write("1 2")
assert mbdae.load("rods.chain").nv == 2
exact = np.ravel(mbdae.sensitivity(run("damping", 0.3), ["force.air.damping"]).signal("travel.arm"))[-1]
low, high = (run("damping", 0.3 + x).signals("travel")["travel.arm"][-1] for x in (-h, h))
assert np.isclose(exact, (high - low) / (2 * h), rtol=1e-6) and exact, (exact, low, high)
"""


def defined(code):
    """The names that a block defines."""
    parts = ast.parse(code).body
    assigned = [t.id for x in parts if isinstance(x, ast.Assign) for t in x.targets]
    return {*assigned, *(x.name for x in parts if isinstance(x, ast.ClassDef | ast.FunctionDef))}


EXAMPLES = [code for code in re.findall(r"^```python\n(.*?)^```$", PAGE, re.S | re.M) if defined(code) & FILES.keys()]


def test_an_example_of_a_file_imports_no_public_names_and_prints_nothing():
    """They are those of a file of the package, below the names of `mbdae`."""
    assert len(EXAMPLES) == len(FILES)
    for code in EXAMPLES:
        assert not re.search(r"^(import mbdae|from mbdae import|print\()", code, re.M), code


def test_no_other_test_has_the_classes_of_examples():
    """A contributor's kind would clash with that of a test."""
    classes = {name for code in EXAMPLES for name in defined(code) if name[0].isupper()}
    uses = {p.name for p in ROOT.glob("tests/**/*.py") if re.search(rf"class ({'|'.join(classes)})\b", p.read_text())}
    assert uses <= {"test_contributed_law.py"}, uses


@pytest.mark.slow
@pytest.mark.native  # derivatives of runs
def test_examples_work_as_files_of_the_package(tmp_path):
    for folder in ("mbdae", "models"):  # with the sources of the core, to which an installed core is compared
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("*.pyc"))
    for code in EXAMPLES:
        (name,) = defined(code) & FILES.keys()
        target = tmp_path / "mbdae" / FILES[name]
        target.parent.mkdir(exist_ok=True)
        target.write_text(code)
    (tmp_path / "mbdae/studies/top_speed/__init__.py").touch()
    for path, (names, entry) in LISTS.items():
        listed = tmp_path / "mbdae" / path
        text = listed.read_text()
        (begin,) = re.findall(r"\n[A-Z]+_GROUPS = \(", text)
        assert entry in PAGE
        listed.write_text(text.replace(begin, f"\nfrom mbdae.solution.travel import {names}\n{begin}\n    {entry},"))
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{PROGRAM}"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert out.returncode == 0, out.stderr
