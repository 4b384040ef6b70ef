"""Sources of the runtime, for FMUs that are compiled on the target platform (FMI 3.0, buildDescription.xml)."""

import zipfile
from pathlib import Path
from xml.etree import ElementTree

from ... import backend
from ...errors import InputError

ARCHIVE = "_native_fmi3_sources.zip"  # written when the core is built: mbdae/native/runtime/pack_sources.py
COMPILED = "compiled.txt"  # file in the archive that lists the files to compile
# The options with which the runtime is built, so that results agree to the last bit.
OPTIONS = "-std=c++17 -O3 -fvisibility=hidden"
DEFINITIONS = {"NDEBUG": "", "EIGEN_MAX_ALIGN_BYTES": "16", "EIGEN_MALLOC_ALREADY_ALIGNED": "1"}


def source_files(identifier: str) -> dict[str, bytes]:
    """Return the contents of ``sources/`` of an FMU by name: C++17 without other libraries, and how to compile it.

    Raises:
        InputError: if the core was built without them.
    """
    core = backend.load()
    path = Path(core.__file__ or "").with_name(ARCHIVE) if core else Path(ARCHIVE)
    if core is None or not path.is_file():
        raise InputError("the sources of the runtime of exported mechanisms are missing: build and install mbdae again")
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    compiled = files.pop(COMPILED).decode().split()
    return files | {"buildDescription.xml": _build_description(identifier, compiled)}


def _build_description(identifier: str, compiled: list[str]) -> bytes:
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ElementTree.SubElement(build, "SourceFileSet", language="C++17", compilerOptions=OPTIONS)
    for name in compiled:
        ElementTree.SubElement(files, "SourceFile", name=name)
    for name, value in DEFINITIONS.items():
        ElementTree.SubElement(files, "PreprocessorDefinition", {"name": name} | ({"value": value} if value else {}))
    ElementTree.SubElement(files, "IncludeDirectory", name=".")
    ElementTree.indent(root)
    document: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    return document
