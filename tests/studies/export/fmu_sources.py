"""FMUs compiled from their own sources with g++, as an importer does: by what buildDescription.xml says."""

import platform
import shutil
import subprocess
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree import ElementTree

import pytest

LIBRARY = f"binaries/{platform.machine()}-linux"


# Without names in common: compiled as one, their templates take a third less time.
JOINED = (("laws.cpp", "kinematics.cpp"), ("runs.cpp", "stages.cpp", "runtime.cpp"))


def compiled(path, folder, extra=()):
    """The library of an FMU, compiled in a folder; ``extra``: further options, after those of the description.

    Skipped without g++.
    """
    if not (compiler := shutil.which("g++")):
        pytest.skip("g++ is not installed")
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder, [name for name in archive.namelist() if name.startswith("sources/")])
    sources = Path(folder) / "sources"
    build = ElementTree.parse(sources / "buildDescription.xml").getroot().find("BuildConfiguration")
    (files,) = build.findall("SourceFileSet")
    options = [*files.get("compilerOptions").split(), "-fPIC"]
    for x in files.findall("PreprocessorDefinition"):
        options.append(f"-D{x.get('name')}={x.get('value') or 1}")
    options += [*(f"-I{sources / x.get('name')}" for x in files.findall("IncludeDirectory")), *extra]

    names = [x.get("name") for x in files.findall("SourceFile")]
    assert sorted(names) == sorted(name for joined in JOINED for name in joined)

    def compile_joined(joined):
        file = sources / f"with_{joined[0]}"
        file.write_text("".join(f'#include "{name}"\n' for name in joined))
        out = file.with_suffix(".o")
        subprocess.run([compiler, *options, "-c", file, "-o", out], check=True, cwd=folder)
        return out

    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(compile_joined, JOINED))
    library = Path(folder) / f"{build.get('modelIdentifier')}.so"
    subprocess.run([compiler, "-shared", *extra, "-o", library, *objects], check=True)
    return library


def with_library(path, library, out):
    """The same FMU with another library."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            if name.startswith(("binaries/", "sources/")):
                continue
            new.writestr(name, old.read(name))
        new.write(library, f"{LIBRARY}/{library.name}")
    return out
