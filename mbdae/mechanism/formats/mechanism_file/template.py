"""Mechanisms with changed parameters: files are read once; dotted paths name the entries of their tables.

gravity.2                       an entry of a list, counted from 0
force.spring.stiffness          a force, closure, driver, stop, clutch, frame or body by its name, and a key of it
start.q.crank, start.v.crank    a start value of a joint
joint.crank_pin.xyz.0           an entry of a source (URDF, MJCF) for a joint: `xyz` and `rpy` in the parent body,
                                `mass`, `com`, `inertia` of the child body, as in a [[body]] table

Names may contain dots; the longest match is used.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from ....errors import InputError, UnknownNameError
from ...checked_table import Table
from ...imported_model import ImportedModel
from ...mechanism import Mechanism
from ...model_settings import Start
from ...time_functions.time_functions import Constant
from ...tree.frames import find_joint, joint_names
from ...tree.tree_terms import copy_model
from ...variant import variant
from ..body_tables import Body
from ..model_library import PARAMETRIC
from .build import body_inertia, build, placement
from .load import ModelSpec, located, make, read
from .parametric import ParametricFile
from .schema import MechanismFile
from .table_entries import TABLES, entry_at, entry_keys, entry_names, first_key, with_entries, with_entry

JOINT = ("xyz", "rpy", "mass", "com", "inertia")  # entries of a source for a joint
START = "start."
WHOLE_TABLES = ("duration", "gravity")  # tables that can be replaced as a whole
ARGUMENTS = {  # arguments of `Mechanism` by table
    "closure": "closures",
    "clutch": "clutches",
    "driver": "drivers",
    "stop": "stops",
    "event": "resets",
    "duration": "duration",
}
CACHE_SIZE = 8  # mechanisms with different parameters, for several threads


class Template:
    """A mechanism file with parameters that can be changed.

    Args:
        path: as for `mbdae.load`, possibly with parameters after the name.

    Attributes:
        parameters: names of the parameters of a mechanism.py, which can be changed in addition to its tables.

    Raises:
        UnknownNameError, InputError: as `mbdae.load`.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = str(path)
        found, _ = located(self.path)
        parametric = ParametricFile(found) if found.suffix == PARAMETRIC else None
        self.parameters = tuple(parametric.parameters) if parametric else ()
        self.functions: Sequence[Any] = ()
        self._read = lru_cache(CACHE_SIZE)(
            lambda text: _without_visuals(read(self.path, json.loads(text), parametric=parametric))
        )
        self._made = lru_cache(CACHE_SIZE)(lambda text: self._make(*json.loads(text)))
        self._first = lru_cache(CACHE_SIZE)(lambda text: self._unchanged(json.loads(text)))

    def spec(self, values: Mapping[str, object]) -> ModelSpec:
        """Return the merged files for the parameters among ``values``, without visuals."""
        return self._read(_as_text({n: x for n, x in values.items() if n in self.parameters}))

    def check(self, values: Mapping[str, object], others: Sequence[str] = ()) -> None:
        """Reject invalid names.

        Args:
            values: values by name.
            others: further valid names, for messages.

        Raises:
            UnknownNameError: with the valid names.
            InputError: for a table that would replace an entry given before it.
        """
        _check_order(list(values))
        mech, spec = self.make({n: x for n, x in values.items() if n in self.parameters}), self.spec(values)
        for name in values:
            root, dot, rest = name.partition(".")
            if name in self.parameters:
                continue
            if root not in (*TABLES, "joint") or not (dot or root in WHOLE_TABLES):
                valid = [f"{t}. ..." for t in (*TABLES, "joint") if t not in WHOLE_TABLES]
                raise UnknownNameError("parameter", name, (*self.parameters, *WHOLE_TABLES, *valid, *others))
            if root == "start":
                check_start(mech, name)
            elif root == "joint":
                _check_joint(spec, name, rest)
            else:
                _check_path(spec.file, name)

    def make(self, values: Mapping[str, object]) -> Mechanism:
        """Return the mechanism with these values; mechanisms that differ only in their start share one model.

        Raises:
            UnknownNameError, InputError: for invalid names or values.
        """
        file_parameters = {n: x for n, x in values.items() if n in self.parameters}
        changed = {n: x for n, x in values.items() if n not in file_parameters and not n.startswith(START)}
        mech = self._made(_as_text([file_parameters, changed]))
        return with_start(mech, {n: x for n, x in values.items() if n.startswith(START) and n not in file_parameters})

    def _make(self, file_parameters: dict[str, Any], changed: dict[str, Any]) -> Mechanism:
        spec, first = self.spec(file_parameters), self._first(_as_text(file_parameters))
        if not changed:
            return first
        file, models = spec.file, spec.models
        joint_values = {n.removeprefix("joint."): x for n, x in changed.items() if n.startswith("joint.")}
        if joint_values:
            models = [_with_joint_values(m, s.prefix, joint_values) for m, s in zip(models, file.source, strict=True)]
        values = {n: x for n, x in changed.items() if not n.startswith("joint.")}
        nested = any(n != other and n.startswith(f"{other}.") for n in values for other in values)
        for group in [{n: x} for n, x in values.items()] if nested else [values]:
            file = with_entries(file, {n: (n, x) for n, x in group.items()})
        return variant(first, **self._changed_arguments(changed, spec._replace(file=file, models=models), first))

    def _changed_arguments(self, changed: Iterable[str], spec: ModelSpec, first: Mechanism) -> dict[str, Any]:
        """Return the changed arguments of `Mechanism`; the model is rebuilt only if bodies change."""
        tables, file = {name.partition(".")[0] for name in changed}, spec.file
        out = {argument: getattr(file, table) for table, argument in ARGUMENTS.items() if table in tables}
        if "force" in tables:
            out["forces"] = [*file.force, *self.functions]
        if not tables.isdisjoint(("body", "flexible", "frame", "joint")):
            out["model"], out["visuals"] = build(file, spec.models, spec.name)
        elif "gravity" in tables:
            out["model"] = copy_model(first.model)
            out["model"].gravity.linear = np.array(file.gravity)
        return out

    def _unchanged(self, file_parameters: dict[str, Any]) -> Mechanism:
        return make(self.spec(file_parameters), self.functions, recorded=False)


def _check_order(names: Sequence[str]) -> None:
    for i, name in enumerate(names):
        if replaced := next((x for x in names[:i] if x.startswith(f"{name}.")), ""):
            raise InputError(f"{name!r} would replace {replaced!r}: give it first, or leave one of them out")


def _check_joint(spec: ModelSpec, name: str, rest: str) -> None:
    """Reject an invalid name of a parameter of a joint, or of a body of the mechanism file."""
    sources = zip(spec.file.source, spec.models, strict=True)
    joints, joint = [s.prefix + n for s, m in sources for n in joint_names(m.model)], rest.partition(".")[0]
    if joint not in joints and joint in [b.name for b in spec.file.body]:
        raise InputError(f"{name!r}: {joint} is a body of the file, name body.{rest}")
    split_joint(rest, joints)


def check_start(mech: Mechanism, name: str) -> None:
    """Reject an invalid name of a start value, ``start.q.crank``.

    Raises:
        UnknownNameError: lists the valid names.
    """
    table, _, joint = name.removeprefix(START).partition(".")
    if table not in mech.start_values.tables:
        raise UnknownNameError("entry of start", table, mech.start_values.tables)
    find_joint(mech.model, joint)


def with_start(mech: Mechanism, values: Mapping[str, object]) -> Mechanism:
    """Return the mechanism with changed start values, ``start.q.crank = 0.3``; all other data are shared.

    Raises:
        UnknownNameError: for an unknown joint.
        InputError: for invalid values.
    """
    if not values:
        return mech
    start: Start = mech.start_values
    for name, value in values.items():
        check_start(mech, name)
        start = with_entry(start, name.removeprefix(START), value, name)
    if not mech.source:
        return variant(mech, start=start)
    file = {**mech.source["file"], "start": start.model_dump(mode="json")}
    return variant(mech, start=start, source={**mech.source, "file": file})


def _check_path(file: MechanismFile, name: str) -> None:
    """Reject a dotted path into the tables of a file that is invalid, or ends at a table."""
    entry: Any = file
    rest = name
    while rest:
        key, rest = first_key(entry, rest, name)
        if isinstance(entry, dict) and key not in entry:
            raise UnknownNameError(f"entry of {name.removesuffix(key).rstrip('.')}", key, entry)
        entry = entry_at(entry, key)
    if isinstance(entry, Constant):  # a number as a function of time
        return
    if isinstance(entry, Table) or entry_names(entry if isinstance(entry, tuple) else ()):
        raise InputError(f"{name!r} is a table, name an entry of it: {', '.join(entry_keys(entry))}")


def split_joint(path: str, joints: Iterable[str]) -> tuple[str, str]:
    """Return the joint and the key of a path."""
    names = list(joints)
    found = [n for n in names if path.startswith(f"{n}.")]
    if not found and path in names:
        raise InputError(f"joint.{path} is a joint: name an entry of it, joint.{path}. {', '.join(JOINT)}")
    if not found:
        raise UnknownNameError("joint of a source", path.rpartition(".")[0] or path, names)
    joint = max(found, key=len)
    rest = path[len(joint) + 1 :]
    key, _, index = rest.partition(".")
    if key not in JOINT:
        raise UnknownNameError(f"entry of joint.{joint}", rest, JOINT)
    entries = getattr(Body(name=joint, parent=""), key)
    _ = index and first_key(entries, index, f"joint.{path}")
    return joint, rest


def _with_joint_values(imported: ImportedModel, prefix: str, joint_values: Mapping[str, object]) -> ImportedModel:
    """Return a source with changed values of its joints and bodies."""
    model = imported.model.copy()
    bodies: dict[str, Any] = {}
    for path, value in joint_values.items():
        names = [prefix + n for n in joint_names(model)]
        if not any(path.startswith(f"{n}.") for n in names):
            continue
        joint, rest = split_joint(path, names)
        body = bodies.get(joint) or as_body(model, joint.removeprefix(prefix))
        bodies[joint] = with_entry(body, rest, value, f"joint.{path}")
        index = model.getJointId(joint.removeprefix(prefix))
        if rest.startswith("rpy"):
            model.jointPlacements[index] = placement(bodies[joint])
        elif rest.startswith("xyz"):
            model.jointPlacements[index] = pin.SE3(model.jointPlacements[index].rotation, np.array(bodies[joint].xyz))
        else:
            model.inertias[index] = body_inertia(bodies[joint]) or pin.Inertia.Zero()
    return replace(imported, model=model)


def as_body(model: pin.Model, joint: str) -> Body:
    """Return a joint and its child body as a table of a mechanism file."""
    index = model.getJointId(joint)
    placement, inertia = model.jointPlacements[index], model.inertias[index]
    tensor = inertia.inertia
    return Body(
        name=joint,
        parent="",
        xyz=placement.translation.tolist(),
        rpy=pin.rpy.matrixToRpy(placement.rotation).tolist(),
        mass=inertia.mass,
        com=inertia.lever.tolist(),
        inertia=[tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
    )


def _as_text(values: object) -> str:
    """Return values of parameters as JSON, which serves as a cache key.

    Raises:
        InputError: for values other than numbers, strings, and lists or tables of these.
    """
    return json.dumps(values, default=_builtin)


def _builtin(x: object) -> Any:
    if isinstance(x, np.generic | np.ndarray):
        return x.tolist()
    raise InputError(f"a parameter takes numbers, texts or lists of numbers, got {x!r:.60}")


def _without_visuals(spec: ModelSpec) -> ModelSpec:
    return spec._replace(models=[replace(m, visuals=None) for m in spec.models])
