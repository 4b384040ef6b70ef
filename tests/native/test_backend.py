"""Selection of the back end: the guard of the compiled core, the choice, and its messages."""

import json
import sys
import tomllib
import warnings
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

import pinocchio as pin
import pytest
from click.testing import CliRunner
from shared import shared_model

import mbdae
from mbdae import backend
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError

HERE = version("libpinocchio")


@pytest.fixture
def fresh(monkeypatch):
    """Reset the cached core and warnings, before and after."""
    found = (backend._core, backend._warn)
    for f in found:
        f.cache_clear()
    yield monkeypatch
    for f in found:
        f.cache_clear()
    with warnings.catch_warnings(action="ignore"):
        monkeypatch.undo()
        backend.select_core("auto")  # where the core is missing, later tests must not warn


@pytest.fixture
def core(fresh, tmp_path):
    """Write a stand-in for the core and its version file; its import for another Pinocchio ends the tests."""

    def write(built_for=HERE, code="raise SystemExit('imported')"):
        (tmp_path / "stand_in.py").write_text(code)
        if built_for:
            (tmp_path / backend.BUILT_FOR).write_text(built_for + "\n")
        fresh.syspath_prepend(tmp_path)
        fresh.setattr(backend, "CORE", "stand_in")
        fresh.delitem(sys.modules, "stand_in", raising=False)

    return write


def test_a_core_for_this_pinocchio_is_taken(core):
    core(code="answer = 42")
    assert backend.load().answer == 42
    assert backend.select_core("auto") is backend.select_core("native") is backend.load()
    assert backend.select_core("python") is None
    assert backend.status() == f"native (built for Pinocchio {HERE})"


@pytest.mark.parametrize("built", ["4.0.0", "4.1", HERE + ".1", "41.0"])
def test_a_core_for_another_pinocchio_is_never_imported(core, built):
    core(built)
    assert backend.load() is None
    assert backend.status() == (f"python: built for Pinocchio {built} but {HERE} is installed; install mbdae again")
    assert "stand_in" not in sys.modules


def test_a_core_without_its_version_is_never_imported(core):
    core(built_for=None)
    assert backend.load() is None
    assert f"built for Pinocchio unknown ({backend.BUILT_FOR} is missing) but {HERE}" in backend.status()


@pytest.mark.parametrize("text", [b"\xff\xfe4\x001\x00", "4.1.0 \u00e9".encode("latin-1"), b"\0" * 9, b"4.1.0\x1b[2J"])
def test_a_version_file_that_holds_no_version_is_named_in_one_line(core, tmp_path, text):
    core()
    (tmp_path / backend.BUILT_FOR).write_bytes(text)
    assert backend.load() is None
    assert f"built for Pinocchio unknown ({backend.BUILT_FOR} contains no version) but {HERE}" in backend.status()
    done = CliRunner().invoke(cli, ["info"])
    assert not done.exit_code
    assert done.output.splitlines()[-1] == f"back end: {backend.status()}"


@pytest.mark.parametrize("imported", ["3.9.0", "4.10.0"])
def test_a_pinocchio_from_elsewhere_is_noticed(core, monkeypatch, imported):
    core()
    monkeypatch.setattr(pin, "__version__", imported)
    assert backend.load() is None
    assert f"but {imported} with libpinocchio {HERE} is installed" in backend.status()


def test_a_core_is_imported_once(core):
    """An extension module that is executed again is empty."""
    core(code="answer = []")
    first = backend.load()
    backend._core.cache_clear()
    assert backend.load() is first


def test_threads_wait_for_the_import_of_the_core(core):
    core(code="import time; time.sleep(0.2); answer = 42")
    with ThreadPoolExecutor(2) as threads:
        assert list(threads.map(lambda _: backend.load().answer, range(2))) == [42, 42]


def test_a_core_that_cannot_be_imported_is_named(core):
    core(code="raise ImportError('libboost_python: no such file\\nor folder')")
    assert backend.load() is None
    assert backend.status() == "python: import failed: libboost_python: no such file or folder"


def test_without_the_core_one_warning_says_so(fresh):
    fresh.setattr(backend, "CORE", "mbdae.no_such_core")
    assert backend.load() is None
    assert backend.status().startswith("python: not built ")
    with pytest.warns(UserWarning, match="mbdae computes in Python, .*; python: not built ") as said:
        assert backend.select_core("auto") is None
    assert len(said) == 1
    assert backend.select_core("auto") is backend.select_core("python") is None  # no second one: it would be an error
    with pytest.raises(InputError, match="backend='native' cannot be used, python: not built "):
        backend.select_core("native")


def test_an_unknown_backend_is_rejected():
    with pytest.raises(UnknownNameError, match=r"unknown backend 'natve'.*'native'.*auto, native, python"):
        backend.select_core("natve")


def test_a_source_tree_and_an_installation_are_distinguished(tmp_path):
    assert backend._not_built(tmp_path).startswith("not built for this Python")
    (tmp_path / "native").mkdir()
    (tmp_path / "native" / "CMakeLists.txt").touch()
    assert f"not built in {tmp_path};" in backend._not_built(tmp_path)


def test_info_names_versions_and_back_end():
    alone, json_alone, model, json_model = (
        CliRunner().invoke(cli, ["info", *more]).output
        for more in ([], ["--json"], ["pendulum"], ["pendulum", "--json"])
    )
    line = f"back end: {backend.status()}"
    names = ("mbdae", "pin", "numpy", "scipy")
    assert alone.splitlines() == [*(f"{name} {version(name)}" for name in names), line]
    assert json.loads(json_alone) == {"versions": {n: version(n) for n in names}, "backend": backend.status()}
    assert model.splitlines() == [*str(mbdae.info(shared_model("pendulum"))).splitlines(), line]
    assert json.loads(json_model)["backend"] == backend.status()


def test_an_installation_asks_for_the_pinocchio_that_its_core_is_built_for():
    about = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    asked = {*about["build-system"]["requires"], *about["project"]["dependencies"]}
    assert {f"libpinocchio=={HERE}", f"pin=={HERE}"} <= asked


@pytest.mark.native
def test_the_core_knows_what_it_was_built_for():
    assert backend.load().version() == HERE
