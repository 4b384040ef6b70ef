"""Names of the dimensions of a mechanism file, for patterns as ``joint.*.xyz.*``."""

from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase

from ...errors import UnknownNameError
from ...mechanism.formats.template import Template
from ...mechanism.frames import joint_names

WILD = "*?["
ENTRIES = ("xyz", "rpy")
CLOSURE_KEYS = ("length", "radius", "radius_a", "radius_b", "offset", "pitch")


def expanded(make: object, tolerances: Mapping[str, float]) -> tuple[dict[str, float], set[str]]:
    """Return tolerances by full names, and those names that come from patterns; a full name has precedence.

    Patterns are those of `fnmatch`; they match placements and lengths: ``frame.N.xyz.0``, ``body.N.rpy.2``,
    ``joint.N.xyz.1``, ``closure.N.length``.

    Raises:
        UnknownNameError: for a pattern that matches no dimension; lists them.
    """
    if not isinstance(make, Template):
        return dict(tolerances), set()
    out: dict[str, float] = {}
    for pattern, size in tolerances.items():
        if not set(pattern) & set(WILD):
            continue
        known = list(_dimensions(make))
        matched = [name for name in known if fnmatchcase(name, pattern)]
        if not matched:
            raise UnknownNameError("pattern of dimensions", pattern, known)
        out |= dict.fromkeys(matched, size)
    named = {name: size for name, size in tolerances.items() if not set(name) & set(WILD)}
    return {**out, **named}, out.keys() - named.keys()


def _dimensions(make: Template) -> Iterator[str]:
    """Yield the names of placements of joints, bodies and frames, and of lengths of closures."""
    recipe = make.recipe({})
    placed = [f"frame.{x.name}" for x in recipe.file.frame] + [f"body.{x.name}" for x in recipe.file.body]
    for source, part in zip(recipe.file.source, recipe.parts, strict=True):
        placed += [f"joint.{source.prefix}{name}" for name in joint_names(part.model)]
    yield from (f"{name}.{entry}.{i}" for name in placed for entry in ENTRIES for i in range(3))
    for closure in recipe.file.closure:
        given = closure.model_dump()
        yield from (f"closure.{closure.name}.{key}" for key in CLOSURE_KEYS if isinstance(given.get(key), float))
