"""Every public method is documented, perhaps by the class that it inherits from, and what comments name exists."""

import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import mbdae

ROOT = Path(__file__).parents[1]
SOURCES = [p for p in sorted((ROOT / "mbdae").rglob("*")) if p.suffix in (".py", ".cpp", ".hpp", ".md", ".txt")]
SKIPPED = {"mbdae.__main__"}  # runs the command line when it is imported


def modules():
    for found in pkgutil.walk_packages(mbdae.__path__, "mbdae."):
        if found.name not in SKIPPED and not found.name.split(".")[-1].startswith("_"):
            yield importlib.import_module(found.name)


def members(cls):
    for name, member in vars(cls).items():
        if name.startswith("_"):
            continue
        if isinstance(member, property | classmethod | staticmethod) or inspect.isfunction(member):
            yield name


def undocumented(cls):
    return [f"{cls.__module__}.{cls.__qualname__}.{n}" for n in members(cls) if not inspect.getdoc(getattr(cls, n))]


def test_public_methods_have_docstrings():
    classes = {
        cls
        for module in modules()
        for name, cls in vars(module).items()
        if inspect.isclass(cls) and cls.__module__ == module.__name__ and not name.startswith("_")
    }
    assert len(classes) > 200
    assert not sorted(n for cls in classes for n in undocumented(cls))


def is_defined(name):
    """Whether a dotted name is a module, or a name that its longest module defines."""
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:n])
        file = path.with_suffix(".py") if path.with_suffix(".py").is_file() else path / "__init__.py"
        if file.is_file():
            if n == len(parts):
                return True
            anywhere = rf"\b{parts[n]}\b"
            found = anywhere if file.name == "__init__.py" else rf"(?:def|class) {parts[n]}\b|^ *{parts[n]}\b[:=, ]"
            return bool(re.search(found, file.read_text("utf-8"), re.M))
    return False


def test_files_and_names_in_comments_exist():
    for source in SOURCES:
        text = source.read_text("utf-8")
        for path in re.findall(r"\bmbdae/(?!_native)[\w/]+\.py\b", text):
            assert (ROOT / path).is_file(), f"{source.name} names {path}"
        for name in re.findall(r"`(mbdae(?:\.\w+)+)`", text):
            assert is_defined(name), f"{source.name} names {name}"
    assert not is_defined("mbdae.solution.columns.signals")
