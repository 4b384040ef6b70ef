"""Every public method is documented, perhaps by the class that it inherits from."""

import importlib
import inspect
import pkgutil

import mbdae

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
