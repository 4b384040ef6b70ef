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

    def compile_one(x):
        out = Path(folder) / f"{x.get('name').replace('/', '_')}.o"
        subprocess.run([compiler, *options, "-c", sources / x.get("name"), "-o", out], check=True, cwd=folder)
        return out

    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(compile_one, files.findall("SourceFile")))
    library = Path(folder) / f"{build.get('modelIdentifier')}.so"
    subprocess.run([compiler, "-shared", *extra, "-o", library, *objects], check=True)
    return library


def with_library(path, library, out):
    """The same FMU with another library."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            if name.startswith(("binaries/", "sources/")):
                continue
            new.writestr(name, old.read(name))
        new.write(library, f"{LIBRARY}/{library.name}")
    return out
