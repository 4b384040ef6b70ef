"""The C++ of CONTRIBUTING's force: its derivatives, the same law without them, and an older core without the law."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import mbdae
from mbdae import backend
from mbdae.errors import InputError, NotCompiled
from mbdae.mechanism.forces.linear import Linear

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / ".github" / "CONTRIBUTING.md").read_text("utf-8")
(LAW,) = re.findall(r"^```cpp\n(.*?)^```$", PAGE, re.S | re.M)
COMPILER = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
HARNESS = """
#include <cstdio>

#include "drag.cpp"

// Four velocities; the law needs no kinematics.
mbdae::MultibodyTree::MultibodyTree(const void*, const Tolerances& tolerances, std::vector<ModalBody>)
    : tolerances(tolerances), nq(4), nv(4), joints(5) {}
struct mbdae::MultibodyTree::Workspace {};
mbdae::MultibodyTree::~MultibodyTree() {}

int main() {
  const mbdae::MultibodyTree m(nullptr, {}, {});
  mbdae::Law law;
  law.rows = {2}, law.a = {0.7};
  const mbdae::LawKind& kind = mbdae::laws::drag;
  if (!kind.is_valid(law, {4, 4, 5})) return 1;
  for (double v2 : {-3.0, -0.2, 0.5, 4.0}) {
    double q[4] = {}, v[4] = {1, 2, v2, 3}, out[8] = {}, by[80] = {};
    kind.add(law, {m, 0, q, v, nullptr}, {out, out + 4, nullptr});
    kind.partials(law, {m, 0, q, v, nullptr}, {by, by + 40, nullptr, 10, 8});
    for (double x : out) std::printf("%.17g ", x);
    for (double x : by) std::printf("%.17g ", x);
    std::puts("");
  }
  law.rows = {4};
  return kind.is_valid(law, {4, 4, 5}) ? 2 : 0;
}
"""

compiler = pytest.mark.skipif(not COMPILER, reason="needs a C++ compiler")


@pytest.fixture(scope="module")
def words(tmp_path_factory):
    """The command of the compiler, with the headers of laws compiled once."""
    folder, header = tmp_path_factory.mktemp("headers"), "mechanism/joint_law.hpp"
    sources = ROOT / "mbdae" / "native"
    words = [COMPILER, "-std=c++17", "-O0", "-Wall", "-Wextra", "-Werror", "-I", str(sources)]
    (folder / "law.hpp").write_text(f'#include "{header}"\n')
    subprocess.run([*words, "-x", "c++-header", "law.hpp", "-o", "law.hpp.gch"], cwd=folder, check=True)
    return [*words, "-include", str(folder / "law.hpp")]


def compiled(tmp_path, words, law):
    (tmp_path / "drag.cpp").write_text(law)
    (tmp_path / "try.cpp").write_text(HARNESS)
    return subprocess.run([*words, "try.cpp", "-o", "try"], cwd=tmp_path, capture_output=True, text=True)


@pytest.mark.slow
@compiler
def test_the_law_has_the_derivatives_of_its_force(tmp_path, words):
    done = compiled(tmp_path, words, LAW)
    assert not done.returncode, done.stderr
    lines = subprocess.run([tmp_path / "try"], capture_output=True, text=True, check=True).stdout.splitlines()
    for line, v in zip(lines, (-3.0, -0.2, 0.5, 4.0), strict=True):
        numbers = np.array(line.split(), float)
        force, by = numbers[:8].reshape(2, 4), numbers[8:].reshape(2, 4, 10)
        expected, derivative = np.zeros((2, 4)), np.zeros((2, 4, 10))
        expected[1, 2], derivative[1, 2, 4 + 2] = -0.7 * abs(v) * v, -2 * 0.7 * abs(v)
        np.testing.assert_allclose(force, expected, rtol=1e-15)
        np.testing.assert_allclose(by, derivative, rtol=1e-15)


def test_the_force_in_python_has_the_derivatives_of_its_formula():
    (code,) = re.findall(r"^```python\n(.*?class JointDrag.*?)^```$", PAGE.partition("### A force")[2], re.S | re.M)
    names = {"__name__": "contributed"}
    exec(code, names)
    law, v = names["DragElement"]("drag", 1, 0.7), np.array([2.0, -3.0, 5.0])
    expected = np.zeros((4, 6))
    expected[1, 3 + 1], expected[3, 3 + 1] = -2 * 0.7 * 3.0, 3 * 0.7 * 3.0**2
    np.testing.assert_allclose(law.partials(0.0, np.zeros(3), v, np.empty(0)), expected, rtol=1e-15)
    np.testing.assert_allclose(law.generalized_force(0.0, np.zeros(3), v)[1], [0.0, 0.7 * 3.0**2, 0.0], rtol=1e-15)


@compiler
@pytest.mark.parametrize("kind", ["{is_valid, JointLaw<Drag>::add}", "{is_valid, JointLaw<Drag>::add, nullptr}"])
def test_a_law_without_derivatives_does_not_compile(tmp_path, words, kind):
    law = LAW.replace("= joint_law<Drag>()", kind.replace("is_valid", "Drag::is_valid"))
    done = compiled(tmp_path, words, law)
    assert done.returncode
    assert re.search(r"(use of|call to) deleted", done.stderr), done.stderr
    assert "LawKind" in done.stderr


@pytest.mark.slow
@compiler
def test_a_conservative_part_without_a_potential_does_not_compile(tmp_path, words):
    formula = "static S effort", "return -law.a[0] * abs(v) * v;"
    conservative = "static Effort<S> effort", "return {-law.a[0] * v, 0};"
    law = LAW
    for before, after in zip(formula, conservative, strict=True):
        assert before in law
        law = law.replace(before, after)
    done = compiled(tmp_path, words, law)
    assert done.returncode
    assert re.search(".potential. is not a member|no member named .potential", done.stderr), done.stderr
    potential = "static double potential(const Law&, const ForcePoint&) { return 0; }\n};\n\nextern"
    done = compiled(tmp_path, words, law.replace("};\n\nextern", potential))
    assert not done.returncode, done.stderr


@pytest.mark.native
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
def test_a_law_that_the_core_was_built_without_runs_in_python(monkeypatch, method):
    damping = [mbdae.JointDamping(joint="rocker", damping=0.3)]
    expected = mbdae.solve(mbdae.load("four_bar", forces=damping), (0, 0.2), method=method)
    mech = mbdae.load("four_bar", forces=damping)
    monkeypatch.setattr(Linear, "core_data", lambda self: {"kind": "drag", "rows": [0], "a": [1.0]})
    with pytest.raises(NotCompiled, match=r"kind 'drag': it was built before"):
        mech.system(native=backend.load())
    sol = mbdae.solve(mech, (0, 0.2), method=method)
    assert sol.stats["backend"] == "python"
    np.testing.assert_allclose(sol.q[-1], expected.q[-1], rtol=1e-9)
    with pytest.raises(
        InputError, match=r"^backend='native' does not support kind 'drag': it was built before that was"
    ):
        mbdae.solve(mech, (0, 0.2), method=method, backend="native")
