"""Parameters of loaded mechanisms: current values, and mechanisms with other values."""

import json
from functools import lru_cache
from typing import Any

from ....errors import InputError
from ...forces import FORCES
from ...mechanism import Mechanism
from ...time_functions.time_functions import Constant
from ...tree.frames import joint_names
from ..body_tables import Body
from .load import ModelSpec, spec_from_mechanism
from .table_entries import entry_at, first_key
from .template import CACHE_SIZE, Template, as_body, split_joint


class LoadedModel(Template):
    """The files from which a mechanism was loaded, as a template.

    Args:
        mech: a mechanism from `mbdae.load`.

    Raises:
        InputError: for a mechanism that was not created from files.
    """

    def __init__(self, mech: Mechanism) -> None:
        if not mech.source:
            raise InputError("the mechanism was not read from files: give model=, a file or a function that makes it")
        spec = spec_from_mechanism(mech)
        self.path, self.parameters = spec.name, ()
        self.functions = [f for f in mech.forces if not isinstance(f, FORCES)]
        self._read = lru_cache(1)(lambda text: spec)
        self._made = lru_cache(CACHE_SIZE)(lambda text: self._make(*json.loads(text)))
        self._first = lru_cache(1)(lambda text: self._unchanged({}))


def parameter_value(template: Template, name: str) -> float:
    """Return the value of the parameter with a dotted name.

    Raises:
        UnknownNameError: for an invalid path.
        InputError: for an entry that is missing or not a number, or a parameter of a file of which only tables remain.
    """
    spec = template.spec({})
    given = {p["name"]: p["value"] for p in spec.parameters}
    if name in given and name not in template.parameters:
        raise InputError(
            f"{name!r} is a parameter of {spec.name}, and a loaded mechanism has only its tables: "
            "give the file itself, model="
        )
    entry: Any = given.get(name, spec.file)
    if name not in given:
        template.check({name: 0.0})
        rest = name
        if name.startswith("joint."):
            entry, rest = joint_entry(spec, name.removeprefix("joint."))
        while rest:
            key, rest = first_key(entry, rest, name)
            entry = entry_at(entry, key)
    entry = entry.value if isinstance(entry, Constant) else entry
    if isinstance(entry, bool) or not isinstance(entry, int | float):
        raise InputError(f"{name!r} is not a number, but {entry!r:.60}: give its value, name = value")
    return float(entry)


def joint_entry(spec: ModelSpec, path: str) -> tuple[Body, str]:
    """Return the joint of a source as a body table, and the key within it."""
    for source, m in zip(spec.file.source, spec.models, strict=True):
        names = [source.prefix + n for n in joint_names(m.model)]
        if any(path.startswith(f"{n}.") for n in names):
            joint, rest = split_joint(path, names)
            return as_body(m.model, joint.removeprefix(source.prefix)), rest
    raise InputError(f"no source has joint.{path}")
