"""The public names: imported on use, and all of them declared for editors and type checkers."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import mbdae
from mbdae.mechanism import forces

SOURCE = Path(mbdae.__file__)


def typed():
    """Name and module of each import for type checkers, and of other declarations for them."""
    block = next(node for node in ast.parse(SOURCE.read_text()).body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname: f"mbdae.{node.module}" for node in imports for alias in node.names}


def test_editors_know_the_names_that_are_found():
    assert typed() == mbdae._modules_of_names()
    assert sorted(typed()) == mbdae.__all__
    assert {*mbdae.__all__, "__version__"} <= set(dir(mbdae))


def test_every_force_is_found():
    assert {name: getattr(mbdae, name) for name in forces.NAMES} == forces.NAMES


def test_a_name_is_imported_when_it_is_used():
    names = ("MbdaeError", "Tableau")
    code = "import sys, mbdae\n" + "\n".join(f"mbdae.{name}; print('numpy' in sys.modules)" for name in names)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


def test_modules_are_imported_when_they_are_used():
    code = "import sys, mbdae\nprint(mbdae.backend.BACKENDS, mbdae.errors.InputError.__name__, 'numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"{mbdae.backend.BACKENDS} InputError False"


def test_a_name_is_the_same_each_time():
    assert mbdae.Mechanism is mbdae.mechanism.Mechanism
    assert mbdae.drift is mbdae.studies.drift.drift.drift
    assert mbdae.METHODS is mbdae.methods.METHODS


@pytest.mark.parametrize("name", ["laod", "Springs", "_repr_html_"])
def test_a_name_that_does_not_exist_is_rejected(name):
    with pytest.raises(AttributeError, match=f"'mbdae' has no attribute '{name}'"):
        getattr(mbdae, name)


def test_all_names_can_be_imported_at_once():
    names = {}
    exec("from mbdae import *", names)
    assert set(mbdae.__all__) <= set(names)
