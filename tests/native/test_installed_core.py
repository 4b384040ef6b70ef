"""A clone of the sources computes with the core of an installed mbdae, where both have the same sources of the core."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mbdae import backend, installed_core

SOURCES = Path(__file__).parents[2] / "mbdae"  # of the clone whose tests run, with any mbdae
NATIVE = backend.load()
CORE = Path(str(NATIVE.__file__)) if NATIVE else None  # of this clone, or of the installed mbdae
RUN = """
import json, warnings
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    import mbdae
    sol = mbdae.solve("four_bar", (0, 0.1))
    from mbdae import backend
print(json.dumps([mbdae.__file__, sol.stats["backend"], backend.status(), [str(x.message) for x in said]]))
"""


@pytest.fixture
def clone(tmp_path):
    """Sources without a core, as git has them; with their bytecode, which Python would compile at each start."""
    folder = tmp_path / "clone"
    built = shutil.ignore_patterns("_native*.so", "_native*.txt")
    shutil.copytree(SOURCES, folder / "mbdae", ignore=built)
    (folder / "models").symlink_to(SOURCES.parent / "models")
    return folder


@pytest.fixture
def site(tmp_path):
    """An installed mbdae: its core, the files beside it, and its metadata."""
    folder = tmp_path / "site" / "mbdae"
    info = folder.parent / "mbdae-0.1.0.dist-info"
    folder.mkdir(parents=True)
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mbdae\nVersion: 0.1.0\n")
    if CORE:
        shutil.copy(CORE, folder)
        shutil.copy(CORE.with_name(backend.BUILT_FOR), folder)
    if CORE and CORE.parent != SOURCES:
        shutil.copy(CORE.with_name(installed_core.BUILT_FROM), folder)  # as it was built
    else:
        write_digest(folder)
    return folder


def write_digest(folder, sources=SOURCES / "native"):
    program = [sys.executable, installed_core.__file__, sources, folder / installed_core.BUILT_FROM]
    subprocess.run(program, check=True)


def in_process(clone, environment):
    done = subprocess.run([sys.executable, "-c", RUN], cwd=clone, env=environment, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    return done.stdout


def in_kernel(clone, environment):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(RUN)])
    nbclient.NotebookClient(book, timeout=300, resources={"metadata": {"path": str(clone)}}).execute(env=environment)
    return "".join(output.text for output in book.cells[0].outputs if output.get("name") == "stdout")


def run_in(clone, site, start=in_process):
    """File of mbdae, back end of a run, status, warnings: in Python that starts in the clone."""
    environment = {**os.environ, "PYTHONPATH": str(site.parent)}
    environment.pop("PYTHONSAFEPATH", None)  # the folder where Python starts comes first
    file, *found = json.loads(start(clone, environment))
    assert Path(file).parent == clone / "mbdae"
    return found


@pytest.mark.slow
@pytest.mark.skipif(CORE is None, reason="needs the compiled core")
@pytest.mark.parametrize("start", [in_process, in_kernel])
def test_a_clone_takes_the_core_of_its_installation(clone, site, start):
    used, status, said = run_in(clone, site, start)
    assert (used, said) == ("native", [])
    assert status.endswith(f", installed in {site})")


@pytest.mark.slow
@pytest.mark.skipif(CORE is None, reason="needs the compiled core")
def test_a_core_of_other_sources_or_for_another_pinocchio_is_not_taken(clone, site):
    """The same version with one line more is another core; Python goes on, and says why."""
    source = next((clone / "mbdae" / "native" / "run").glob("*.hpp"))
    text = source.read_text()
    source.write_text(f"{text}// another line\n")
    used, status, said = run_in(clone, site)
    assert used == "python"
    assert f"the core in {site} is not built from the sources in {clone / 'mbdae' / 'native'}" in status
    assert [status in x for x in said] == [True]
    source.write_text(text)
    (site / backend.BUILT_FOR).write_text("4.0.9\n")
    used, status, said = run_in(clone, site)
    assert used == "python"
    assert "built for Pinocchio 4.0.9 but" in status
    assert len(said) == 1


def pretend(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


FILES = {"CMakeLists.txt": "project()", "run/a.cpp": "int a;", "laws/more/b.cpp": "int b;", "run/a.hpp": "int c;"}


@pytest.mark.parametrize("changed", [*FILES, "math/new.hpp", "renamed"])
def test_the_digest_sees_every_source_and_nothing_else(tmp_path, changed):
    pretend(tmp_path, FILES)
    before = installed_core.digest(tmp_path)
    pretend(tmp_path, {"README.md": "words", ".clang-format": "style", "build.txt": "rest"})
    assert installed_core.digest(tmp_path) == before
    if changed == "renamed":
        (tmp_path / "run" / "a.cpp").rename(tmp_path / "run" / "z.cpp")
    else:
        pretend(tmp_path, {changed: "int d;"})
    assert installed_core.digest(tmp_path) != before


def test_the_search_passes_over_what_is_no_installed_core(tmp_path, monkeypatch):
    """No sources to compare with, no core, the clone itself: none is taken, and the reason is the usual one."""
    package, site = tmp_path / "clone" / "mbdae", tmp_path / "site" / "mbdae"
    pretend(site.parent / "mbdae-0.1.0.dist-info", {"METADATA": "Metadata-Version: 2.1\nName: mbdae\nVersion: 0.1.0\n"})
    monkeypatch.setattr(sys, "path", [str(package.parent), str(site.parent)])
    core = f"_native{installed_core.EXTENSION_SUFFIXES[0]}"
    pretend(package, {"__init__.py": ""})
    pretend(site, {core: "not read"})
    assert installed_core.find_installed(package, "_native") == (None, "")  # nothing to compare with
    pretend(package / "native", FILES)
    path, reason = installed_core.find_installed(package, "_native")
    assert path is None
    assert "is not built from the sources" in reason  # no digest beside it
    write_digest(site, package / "native")
    assert installed_core.find_installed(package, "_native") == (site / core, "")
    assert installed_core.find_installed(package, "_other") == (None, "")
    (site / core).unlink()
    assert installed_core.find_installed(package, "_native") == (None, "")
