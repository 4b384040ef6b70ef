"""Parameters of loaded mechanisms: current values, and mechanisms with other values."""

import json
from functools import lru_cache
from typing import Any

from ...errors import InputError
from ..forces import FORCES
from ..frames import joint_names
from ..mechanism import Mechanism
from ..time_functions import Constant
from .load import Recipe, recipe_of
from .schema import Body
from .template import KEPT, Template, as_body, first_key, split_joint


class LoadedModel(Template):
    """The files of a mechanism, as kept by it.

    Args:
        mech: from `mbdae.load`.

    Raises:
        InputError: for a mechanism that was not created from files.
    """

    def __init__(self, mech: Mechanism) -> None:
        if not mech.source:
            raise InputError("the mechanism was not read from files: give model=, a file or a function that makes it")
        recipe = recipe_of(mech)
        self.path, self.parameters = recipe.name, ()
        self.functions = [f for f in mech.forces if not isinstance(f, FORCES)]
        self._read = lru_cache(1)(lambda text: recipe)
        self._made = lru_cache(KEPT)(lambda text: self._make(*json.loads(text)))


def number(template: Template, name: str) -> float:
    """Return the number that a dotted name refers to.

    Raises:
        UnknownNameError: for an invalid path.
        InputError: for an entry that is not a number, or is missing.
    """
    recipe = template.recipe({})
    given = {p["name"]: p["value"] for p in recipe.parameters}
    at: Any = given.get(name, recipe.file)
    if name not in given:
        template.check({name: 0.0})
        rest = name
        if name.startswith("joint."):
            at, rest = _joint(recipe, name.removeprefix("joint."))
        while rest:
            key, rest = first_key(at, rest, name)
            at = at.get(key) if isinstance(at, dict) else _entry(at, key)
    at = at.value if isinstance(at, Constant) else at
    if isinstance(at, bool) or not isinstance(at, int | float):
        raise InputError(f"{name!r} is no number, but {at!r:.60}: give its value, name = value")
    return float(at)


def _entry(at: Any, key: str) -> Any:
    return at[int(key)] if isinstance(at, tuple) else getattr(at, key)


def _joint(recipe: Recipe, path: str) -> tuple[Body, str]:
    """Return the joint of a source as a body table, and the key that a path names."""
    for source, part in zip(recipe.file.source, recipe.parts, strict=True):
        names = [source.prefix + n for n in joint_names(part.model)]
        if any(path.startswith(f"{n}.") for n in names):
            joint, rest = split_joint(path, names)
            return as_body(part.model, joint.removeprefix(source.prefix)), rest
    raise InputError(f"no source has joint.{path}")
