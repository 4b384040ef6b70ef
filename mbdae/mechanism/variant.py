"""Variants of a mechanism: changed parameters; data that do not depend on them are shared."""

from collections.abc import Sequence
from copy import copy
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pinocchio as pin

from .closures.constraints import anchors
from .forces import bind_forces, named_forces
from .forces.coulomb_friction import CoulombFriction
from .forces.joint_friction import JointFriction
from .tree.manifold import Manifold
from .tree.tree_terms import structure_of_flexible

if TYPE_CHECKING:
    from .mechanism import Mechanism

SWITCHED = CoulombFriction, JointFriction  # forces that may have rows or modes
UNBOUND = {"start", "duration", "source"}  # arguments on which rows, forces and names do not depend
NUMERICAL = {"forces", "model", "visuals"}  # arguments that may differ in numerical values only
# cached properties that do not depend on these values
INDEPENDENT = {"characteristic_length", "row_scales", "q_scales", "coordinate_scales", "joint_names"}
COPIED = (
    "closures", "drivers", "stops", "clutches", "resets", "visuals", "title", "duration", "order", "settings", "motors",
    "left_out", "remarks",
)  # fmt: skip


def variant(mech: "Mechanism", **changes: Any) -> "Mechanism":
    """Return a mechanism with changed arguments, by their names in `Mechanism`.

    If only numerical values of bodies, frames and forces, the start or the duration change, all other data are shared,
    unless there are modes; otherwise, see `rebuilt`.

    Raises:
        UnknownNameError, InputError: as `Mechanism`.
    """
    if "forces" in changes:
        changes["forces"] = named_forces(changes["forces"], mech.drivers)
    return _shared(mech, changes) if _differ_in_values_only(mech, changes) else rebuilt(mech, **changes)


def rebuilt(mech: "Mechanism", **changes: Any) -> "Mechanism":
    """Rebuild a mechanism with changed arguments, by their names in `Mechanism`.

    If joints, rows, forces and states are of the same kinds, both mechanisms share workspaces, into which the
    parameters of the mechanism that runs next are written in place.

    Raises:
        UnknownNameError, InputError: as `Mechanism`.
    """
    copied = {name: getattr(mech, name) for name in COPIED}
    given = {"model": mech.model, "forces": mech.forces, "start": mech.start_values, **copied, **changes}
    out = type(mech)(**given)
    if _have_same_structure(mech, out):
        out.workspaces = mech.workspaces.of(out)
    return out


def _differ_in_values_only(mech: "Mechanism", changes: dict[str, Any]) -> bool:
    """Return whether the changed arguments differ from those of the mechanism in numerical values only."""
    if not changes.keys() <= {*UNBOUND, *NUMERICAL} or ("model" in changes and mech.switches):
        return False
    forces, model = changes.get("forces", mech.forces), changes.get("model", mech.model)
    if forces is not mech.forces and any(isinstance(f, SWITCHED) for f in forces):
        return False
    return (forces is mech.forces or _are_same_kinds(mech.forces, forces)) and _have_same_topology(mech.model, model)


def _shared(mech: "Mechanism", changes: dict[str, Any]) -> "Mechanism":
    """Return a copy with changed values of the model and its forces, start, duration or source."""
    rebound = "forces" in changes or "model" in changes
    if not rebound:
        _ = mech.row_scales, mech.q_scales, mech.coordinate_scales, mech.joint_names  # once for all variants
    out, kind = copy(mech), cast(Any, type(mech))
    for name in _cached_properties(kind).intersection(vars(out)):
        if rebound or name not in INDEPENDENT:
            del out.__dict__[name]
    vars(out).update({"start_values" if name == "start" else name: x for name, x in changes.items()})
    out.workspaces = mech.workspaces.of(out)
    if rebound:
        _rebind(out, mech, "model" in changes)
    if "start" in changes or out._positions is not mech._positions:
        out._starts = {}
    return out


def _rebind(out: "Mechanism", mech: "Mechanism", model_changed: bool) -> None:
    """Replace all data that depend on the values of forces, and of the model if it has changed."""
    if model_changed:
        out.manifold = Manifold(out.model)
        out.closure_anchors = [(c, anchors(out.model, c)) for c, _ in mech.closure_anchors]
    elif [getattr(f, "frames", None) for f in out.forces] == [getattr(f, "frames", None) for f in mech.forces]:
        vars(out)["characteristic_length"] = mech.characteristic_length
    if model_changed or out.characteristic_length != mech.characteristic_length:
        out._positions = {}  # forces do not act on assembly
    out.states = bind_forces(out.forces, out.model, out.make_workspace()).states()


@cache
def _cached_properties(kind: Any) -> frozenset[str]:
    return frozenset(name for name in dir(kind) if isinstance(getattr(kind, name), cached_property))


def _are_same_kinds(before: Sequence[object], after: Sequence[object]) -> bool:
    """Return whether forces or rows have the same types and names, one by one."""
    kinds = [[(type(x), getattr(x, "name", "")) for x in items] for items in (before, after)]
    return kinds[0] == kinds[1]


def _have_same_topology(a: pin.Model, b: pin.Model) -> bool:
    """Return whether two models have the same joints and frames, up to numerical values."""
    if a is b:
        return True
    frames = [[(f.name, f.parentJoint, f.type) for f in model.frames] for model in (a, b)]
    return frames[0] == frames[1] and _tree(a) == _tree(b)


def _tree(model: pin.Model) -> tuple[Any, ...]:
    return list(model.names), list(model.joints), list(model.parents), structure_of_flexible(model)


def _have_same_structure(a: "Mechanism", b: "Mechanism") -> bool:
    """Return whether the workspaces of a mechanism can be bound to another one."""
    kinds = _are_same_kinds(a.forces, b.forces) and _are_same_kinds(a.constraints, b.constraints)
    rows = a.row_names == b.row_names and np.array_equal(a.positional, b.positional)
    return kinds and rows and list(a.states) == list(b.states) and _tree(a.model) == _tree(b.model)
