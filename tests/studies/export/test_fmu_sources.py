"""FMUs with sources: the compiled sources compute as the runtime does, without errors of memory."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest
from fmu_sources import compiled, with_library
from sanitized_fmus import results

import mbdae
from mbdae import backend
from mbdae.errors import InputError
from mbdae.studies.export import source_files

pytestmark = [
    pytest.mark.native,
    pytest.mark.skipif(
        not Path(backend.load().__file__).with_name(source_files.ARCHIVE).is_file(),
        reason=f"the core was built without {source_files.ARCHIVE}",
    ),
]
# compiled fast: checks of memory are calls instead of code in place, and the compiler frees no memory before 2 GB
PARAMETERS = ("asan-instrumentation-with-call-threshold=0", "ggc-min-expand=1000", "ggc-min-heapsize=2000000")
SANITIZERS = ("-O0", "-UNDEBUG", "-fsanitize=address", *(f"--param={x}" for x in PARAMETERS))
MODELS = ("slider_crank", "pendulum_on_stop", "stick_slip_slider", "bricard", "differential_drive")


def test_the_archive_has_what_it_includes(tmp_path):
    unit = mbdae.export("slider_crank", tmp_path / "crank.fmu", kind="cs", sources=True, step=1e-3)
    with zipfile.ZipFile(unit.path) as archive:
        names = {name.removeprefix("sources/") for name in archive.namelist() if name.startswith("sources/")}
        text = b"".join(archive.read(f"sources/{name}") for name in names if not name.startswith("Eigen/"))
    assert {"buildDescription.xml", "runtime.cpp", "runtime/fmi3.cpp", "Eigen/Core", "laws.inc"} <= names
    for other in (b"pinocchio/", b"boost/", b"Python.h", b"nanobind"):
        assert b"#include <" + other not in text


def test_a_core_without_sources_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(source_files, "ARCHIVE", "missing.zip")
    with pytest.raises(InputError, match="the sources of the runtime of exported mechanisms are missing"):
        mbdae.export("slider_crank", tmp_path / "x.fmu", sources=True)


@pytest.mark.slow
def test_what_is_compiled_equals_the_runtime_bit_by_bit_without_errors_of_memory(tmp_path):
    """With sanitizers: two instances in threads, saved states, impacts, derivatives."""
    unit = mbdae.export("slider_crank", tmp_path / "unit.fmu", kind="cs", sources=True, step=1e-3)
    library = compiled(unit.path, tmp_path, SANITIZERS)
    data = []
    for name in MODELS:
        (tmp_path / name).mkdir()
        found = mbdae.export(name, tmp_path / name / "unit.fmu", step=1e-2)
        parts = {"states": found.states, "outputs": found.outputs}
        data.append({"path": str(with_library(found.path, library, tmp_path / f"{name}.fmu")), **parts})
        parts["path"] = str(found.path)
        data[-1]["expected"] = results(SimpleNamespace(**parts, inputs=()))
    names = ("libasan.so", "libubsan.so")
    preload = " ".join(subprocess.check_output(["g++", f"-print-file-name={x}"], text=True).strip() for x in names)
    environment = os.environ | {"LD_PRELOAD": preload, "ASAN_OPTIONS": "detect_leaks=0"}
    environment.pop("PYTHONSAFEPATH", None)  # the script imports its neighbours
    called = [sys.executable, Path(__file__).with_name("sanitized_fmus.py"), json.dumps(data)]
    ran = subprocess.run(called, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr[-4000:]
    assert ran.stdout.split() == ["ok"] * len(MODELS)
