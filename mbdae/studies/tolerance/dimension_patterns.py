"""Patterns of the names of dimensions of a mechanism file, as ``joint.*.xyz.*``."""

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from itertools import product

from ...errors import UnknownNameError
from ...mechanism.equations.characteristic_length import CLOSURE_LENGTHS
from ...mechanism.formats.mechanism_file.template import Template
from ...mechanism.tree.frames import joint_names

WILDCARDS = "*?["
ENTRIES = ("xyz", "rpy")


def expand_patterns(factory: object, tolerances: Mapping[str, float]) -> tuple[dict[str, float], set[str]]:
    """Return tolerances by full names, and those names that come from patterns.

    A full name has precedence over patterns, and a pattern over earlier ones. Patterns are those of `fnmatch`; they
    match placements and lengths: ``frame.N.xyz.0``, ``body.N.rpy.2``, ``joint.N.xyz.1``, ``closure.N.length``.

    Raises:
        UnknownNameError: for a pattern that matches no dimension; lists the dimensions.
    """
    if not isinstance(factory, Template):
        return dict(tolerances), set()
    patterns = [name for name in tolerances if set(name) & set(WILDCARDS)]
    known = list(_dimensions(factory)) if patterns else []
    patterns = [name for name in patterns if name not in known]  # names of joints may have brackets
    found: dict[str, float] = {}
    for pattern in patterns:
        matched = [name for name in known if fnmatchcase(name, pattern)]
        if not matched:
            raise UnknownNameError("pattern of dimensions", pattern, known)
        found |= dict.fromkeys(matched, tolerances[pattern])
    named = {name: size for name, size in tolerances.items() if name not in patterns}
    return {**found, **named}, found.keys() - named.keys()


def _dimensions(factory: Template) -> Iterator[str]:
    """Yield the names of placements of joints, bodies and frames, and of lengths of closures."""
    spec = factory.spec({})
    imported = zip(spec.file.source, spec.models, strict=True)
    joints = [f"joint.{source.prefix}{name}" for source, m in imported for name in joint_names(m.model)]
    elements = [*(f"frame.{x.name}" for x in spec.file.frame), *(f"body.{x.name}" for x in spec.file.body), *joints]
    for name, entry, i in product(elements, ENTRIES, range(3)):
        yield f"{name}.{entry}.{i}"
    for closure, key in product(spec.file.closure, CLOSURE_LENGTHS):
        if isinstance(getattr(closure, key, None), float):  # not a list of radii or semi-axes
            yield f"closure.{closure.name}.{key}"
