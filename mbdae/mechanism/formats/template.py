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
from copy import copy
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import InputError, UnknownNameError
from ..checked_table import Table
from ..formulations.workspace_pool import WorkspacePool
from ..frames import find_joint, joint_names
from ..imported_model import ImportedModel
from ..mechanism import Mechanism
from ..model_settings import Start
from ..time_functions import Constant
from .build import body_inertia, placement
from .load import Recipe, make, read
from .model_library import PARAMETRIC, find
from .parametric import parameter_names, split
from .schema import Body, MechanismFile

TABLES = ("body", "closure", "clutch", "driver", "duration", "force", "frame", "gravity", "start", "stop")  # of files
JOINT = ("xyz", "rpy", "mass", "com", "inertia")  # entries of a source for a joint
START = "start."
WHOLE_TABLES = ("duration", "gravity")  # with values for the whole table
CACHE_SIZE = 8  # mechanisms with other parameters, for several threads


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
        file_parameters, _ = split(self.path)
        found = find(file_parameters)
        self.parameters = parameter_names(found) if found.suffix == PARAMETRIC else ()
        self.functions: Sequence[Any] = ()
        self._read = lru_cache(CACHE_SIZE)(lambda text: _without_visuals(read(self.path, json.loads(text))))
        self._made = lru_cache(CACHE_SIZE)(lambda text: self._make(*json.loads(text)))

    def recipe(self, values: Mapping[str, Any]) -> Recipe:
        """Return the files for the parameters among ``values``, without visuals."""
        return self._read(json.dumps({n: x for n, x in values.items() if n in self.parameters}))

    def check(self, values: Mapping[str, Any]) -> None:
        """Reject invalid names.

        Raises:
            UnknownNameError: with the valid names.
        """
        mech, recipe = self.make({n: x for n, x in values.items() if n in self.parameters}), self.recipe(values)
        for name in values:
            root, dot, rest = name.partition(".")
            if name in self.parameters:
                continue
            if root not in (*TABLES, "joint") or not (dot or root in WHOLE_TABLES):
                valid = [f"{t}. ..." for t in (*TABLES, "joint", "solve") if t not in WHOLE_TABLES]
                raise UnknownNameError("parameter", name, (*self.parameters, *WHOLE_TABLES, *valid))
            if root == "start":
                check_start(mech, name)
            elif root == "joint":
                _check_joint(recipe, name, rest)
            else:
                _check_path(recipe.file, name)

    def make(self, values: Mapping[str, Any]) -> Mechanism:
        """Return the mechanism with these values; mechanisms that differ only in their start share one model.

        Raises:
            UnknownNameError, InputError: for invalid names or values.
        """
        file_parameters = {n: x for n, x in values.items() if n in self.parameters}
        changed = {n: x for n, x in values.items() if n not in file_parameters and not n.startswith(START)}
        mech = self._made(json.dumps([file_parameters, changed]))
        return with_start(mech, {n: x for n, x in values.items() if n.startswith(START) and n not in file_parameters})

    def _make(self, file_parameters: dict[str, Any], changed: dict[str, Any]) -> Mechanism:
        recipe = self.recipe(file_parameters)
        file, parts = recipe.file, recipe.parts
        joint_values = {n.removeprefix("joint."): x for n, x in changed.items() if n.startswith("joint.")}
        if joint_values:
            parts = [_with_joint_values(p, s.prefix, joint_values) for p, s in zip(parts, file.source, strict=True)]
        for name, value in changed.items():
            if not name.startswith("joint."):
                file = with_entry(file, name, value, name)
        return make(recipe._replace(file=file, parts=parts), self.functions, recorded=False)


def _check_joint(recipe: Recipe, name: str, rest: str) -> None:
    """Reject an invalid name of a parameter of a joint, or of a body of the mechanism file."""
    sources = zip(recipe.file.source, recipe.parts, strict=True)
    joints, joint = [s.prefix + n for s, p in sources for n in joint_names(p.model)], rest.partition(".")[0]
    if joint not in joints and joint in [b.name for b in recipe.file.body]:
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


def with_start(mech: Mechanism, values: Mapping[str, Any]) -> Mechanism:
    """Return the mechanism with other start values, ``start.q.crank = 0.3``; the rest is shared.

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
    other = copy(mech)
    other.start_values, other._starts, other.workspaces = start, {}, WorkspacePool(other)
    if mech.source:
        other.source = {**mech.source, "file": {**mech.source["file"], "start": start.model_dump(mode="json")}}
    return other


def with_entry(part: Any, path: str, value: Any, whole: str) -> Any:
    """Return a copy of a table with another value at the end of a dotted path.

    Args:
        part: a checked table, a list or a dict; the value itself if the path is empty.
        path: path of the value within ``part``.
        value: the value.
        whole: the complete path, for messages.

    Raises:
        UnknownNameError: for an invalid path.
        InputError: for an invalid value.
    """
    if not path:
        return value
    key, rest = first_key(part, path, whole)
    if isinstance(part, Table):
        said = {k: getattr(part, k) for k in part.model_fields_set if k in type(part).model_fields}
        try:
            return type(part)(**{**said, key: with_entry(getattr(part, key), rest, value, whole)})
        except UnknownNameError:
            raise
        except InputError as e:
            raise InputError(str(e) if str(e).startswith(whole) else f"{whole}: {e}") from None
    if isinstance(part, dict):
        return {**part, key: with_entry(part.get(key), rest, value, whole)}
    at = int(key)
    return (*part[:at], with_entry(part[at], rest, value, whole), *part[at + 1 :])


def first_key(part: Any, path: str, whole: str) -> tuple[str, str]:
    """Return the first key of a path, which may contain dots, and the rest of the path; list entries are numbered."""
    if isinstance(part, dict):  # joint = value: the model checks the names of joints
        return path, ""
    keys = _keys(part)
    found = [k for k in keys if path == k or path.startswith(f"{k}.")]
    if not found:
        above = whole.removesuffix(path).rstrip(".") or "the mechanism"
        raise UnknownNameError(f"entry of {above}", path, keys)
    name = max(found, key=len)
    return keys[name], path[len(name) + 1 :]


def _keys(part: Any) -> dict[str, str]:
    """Return the valid next keys of a path, each with its key or index."""
    if isinstance(part, MechanismFile):
        return {k: k for k in TABLES}
    if isinstance(part, Table):
        return {k: k for k in type(part).model_fields}
    if isinstance(part, tuple):
        return _names(part) or {str(i): str(i) for i in range(len(part))}
    return {}


def _names(entries: tuple[Any, ...]) -> dict[str, str]:
    """Return the indices of the entries of a list of tables by name; unnamed ones by kind and number."""
    out = {}
    for i, entry in enumerate(entries):
        if isinstance(entry, Table) and "name" in type(entry).model_fields:
            out[getattr(entry, "name", "") or f"{getattr(entry, 'kind', '')} {i + 1}".strip()] = str(i)
    return out


def _check_path(file: MechanismFile, name: str) -> None:
    """Reject a dotted path into the tables of a file that is invalid, or ends at a table."""
    at: Any = file
    rest = name
    while rest:
        key, rest = first_key(at, rest, name)
        at = at[int(key)] if isinstance(at, tuple) else getattr(at, key)
    if isinstance(at, Constant):  # a number as a function of time
        return
    if isinstance(at, Table) or _names(at if isinstance(at, tuple) else ()):
        raise InputError(f"{name!r} is a table, name an entry of it: {', '.join(_keys(at))}")


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
    _ = index and first_key(getattr(Body(name=joint, parent=""), key), index, f"joint.{path}")
    return joint, rest


def _with_joint_values(part: ImportedModel, prefix: str, joint_values: Mapping[str, Any]) -> ImportedModel:
    """Return a source with other values of its joints and bodies."""
    model = part.model.copy()
    bodies: dict[str, Any] = {}
    for path, value in joint_values.items():
        names = [prefix + n for n in joint_names(model)]
        if not any(path.startswith(f"{n}.") for n in names):
            continue
        joint, rest = split_joint(path, names)
        body = bodies.get(joint) or as_body(model, joint.removeprefix(prefix))
        bodies[joint] = with_entry(body, rest, value, f"joint.{path}")
        at = model.getJointId(joint.removeprefix(prefix))
        if rest.startswith("rpy"):
            model.jointPlacements[at] = placement(bodies[joint])
        elif rest.startswith("xyz"):
            model.jointPlacements[at] = pin.SE3(model.jointPlacements[at].rotation, np.array(bodies[joint].xyz))
        else:
            model.inertias[at] = body_inertia(bodies[joint]) or pin.Inertia.Zero()
    return replace(part, model=model)


def as_body(model: pin.Model, joint: str) -> Body:
    """Return a joint and its child body as a table of a mechanism file."""
    at = model.getJointId(joint)
    place, inertia = model.jointPlacements[at], model.inertias[at]
    tensor = inertia.inertia
    return Body(
        name=joint,
        parent="",
        xyz=place.translation.tolist(),
        rpy=pin.rpy.matrixToRpy(place.rotation).tolist(),
        mass=inertia.mass,
        com=inertia.lever.tolist(),
        inertia=[tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
    )


def _without_visuals(recipe: Recipe) -> Recipe:
    return recipe._replace(parts=[replace(p, visuals=None) for p in recipe.parts])
