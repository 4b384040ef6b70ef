"""Variants of a mechanism: other parameters, and what does not depend on them shared."""

from collections.abc import Sequence
from copy import copy
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .forces import bind_forces, named_forces
from .forces.coulomb_friction import CoulombFriction
from .forces.joint_friction import JointFriction
from .tree.tree_terms import structure_of_flexible

if TYPE_CHECKING:
    from .mechanism import Mechanism

SWITCHED = CoulombFriction, JointFriction  # forces that may have rows or modes
UNBOUND = {"start", "duration", "source"}  # arguments of which rows, forces and names do not depend
# cached properties that do not depend on these
INDEPENDENT = {"characteristic_length", "row_scales", "q_scales", "coordinate_scales", "joint_names"}
KEPT = (
    "closures", "drivers", "stops", "clutches", "resets", "visuals", "title", "duration", "order", "settings", "motors",
    "left_out", "remarks",
)  # fmt: skip


def variant(mech: "Mechanism", **parts: Any) -> "Mechanism":
    """Return a mechanism with other parts, by the names of the arguments of `Mechanism`.

    Where joints, rows, forces and states are of the same kinds, both share their workspaces, into which the parameters
    of the mechanism that runs next are written in place. Forces, a start or a duration of the same kinds alone share
    all the rest, too.

    Raises:
        UnknownNameError, InputError: as `Mechanism`.
    """
    if parts.keys() <= UNBOUND:
        return _shared(mech, parts)
    if parts.keys() <= {*UNBOUND, "forces"}:
        forces = named_forces(parts["forces"], mech.drivers)
        if _are_same_kinds(mech.forces, forces) and not any(isinstance(f, SWITCHED) for f in forces):
            return _shared(mech, parts | {"forces": forces})
    kept = {name: getattr(mech, name) for name in KEPT}
    given = {"model": mech.model, "forces": mech.forces, "start": mech.start_values, **kept, **parts}
    out = type(mech)(**given)
    if _have_same_structure(mech, out):
        out.workspaces = mech.workspaces.of(out)
    return out


def _shared(mech: "Mechanism", parts: dict[str, Any]) -> "Mechanism":
    """Return a copy with other forces of the same kinds, start, duration or source."""
    if "forces" not in parts:
        _ = mech.row_scales, mech.q_scales, mech.coordinate_scales, mech.joint_names  # once for all variants
    out, kind = copy(mech), cast(Any, type(mech))
    for name in _cached_properties(kind).intersection(vars(out)):
        if "forces" in parts or name not in INDEPENDENT:
            del out.__dict__[name]
    vars(out).update({"start_values" if name == "start" else name: x for name, x in parts.items()})
    out.workspaces = mech.workspaces.of(out)
    if [getattr(f, "frames", None) for f in out.forces] == [getattr(f, "frames", None) for f in mech.forces]:
        vars(out)["characteristic_length"] = mech.characteristic_length
    rescaled = out.characteristic_length != mech.characteristic_length
    out._positions = {} if rescaled else mech._positions  # forces do not act on assembly
    if "start" in parts or rescaled:
        out._starts = {}
    if "forces" in parts:
        out.states = bind_forces(out.forces, out.model, out.make_workspace()).states()
    return out


@cache
def _cached_properties(kind: Any) -> frozenset[str]:
    return frozenset(name for name in dir(kind) if isinstance(getattr(kind, name), cached_property))


def _are_same_kinds(before: Sequence[object], after: Sequence[object]) -> bool:
    """Return whether forces or rows have the same types and names, one by one."""
    kinds = [[(type(x), getattr(x, "name", "")) for x in part] for part in (before, after)]
    return kinds[0] == kinds[1]


def _have_same_structure(a: "Mechanism", b: "Mechanism") -> bool:
    """Return whether the workspaces of a mechanism can be bound to another one."""
    pairs = [(a.forces, b.forces), (a.constraints, b.constraints)]
    trees = [(list(m.model.names), list(m.model.joints), list(m.model.parents)) for m in (a, b)]
    rows = a.row_names == b.row_names and np.array_equal(a.positional, b.positional)
    flexible = structure_of_flexible(a.model) == structure_of_flexible(b.model)
    same = trees[0] == trees[1] and flexible and rows and list(a.states) == list(b.states)
    return same and all(_are_same_kinds(*pair) for pair in pairs)
