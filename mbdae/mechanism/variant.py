"""Variants of a mechanism: other parameters, and what does not depend on them shared."""

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
UNBOUND = {"start", "duration", "source"}  # arguments of which rows, forces and names do not depend
NUMBERS = {"forces", "model", "visuals"}  # arguments that may have other numbers alone
# cached properties that do not depend on these
INDEPENDENT = {"characteristic_length", "row_scales", "q_scales", "coordinate_scales", "joint_names"}
KEPT = (
    "closures", "drivers", "stops", "clutches", "resets", "visuals", "title", "duration", "order", "settings", "motors",
    "left_out", "remarks",
)  # fmt: skip


def variant(mech: "Mechanism", **parts: Any) -> "Mechanism":
    """Return a mechanism with other parts, by the names of the arguments of `Mechanism`.

    Other numbers of bodies, frames and forces, a start or a duration share all the rest, unless there are modes;
    otherwise, see `rebuilt`.

    Raises:
        UnknownNameError, InputError: as `Mechanism`.
    """
    if "forces" in parts:
        parts["forces"] = named_forces(parts["forces"], mech.drivers)
    return _shared(mech, parts) if _have_other_numbers(mech, parts) else rebuilt(mech, **parts)


def rebuilt(mech: "Mechanism", **parts: Any) -> "Mechanism":
    """Return a new mechanism with other parts, by the names of the arguments of `Mechanism`.

    Where joints, rows, forces and states are of the same kinds, both share their workspaces, into which the parameters
    of the mechanism that runs next are written in place.

    Raises:
        UnknownNameError, InputError: as `Mechanism`.
    """
    kept = {name: getattr(mech, name) for name in KEPT}
    given = {"model": mech.model, "forces": mech.forces, "start": mech.start_values, **kept, **parts}
    out = type(mech)(**given)
    if _have_same_structure(mech, out):
        out.workspaces = mech.workspaces.of(out)
    return out


def _have_other_numbers(mech: "Mechanism", parts: dict[str, Any]) -> bool:
    """Return whether parts differ from those of a mechanism in numbers alone."""
    if not parts.keys() <= {*UNBOUND, *NUMBERS} or ("model" in parts and mech.switches):
        return False
    forces, model = parts.get("forces", mech.forces), parts.get("model", mech.model)
    if forces is not mech.forces and any(isinstance(f, SWITCHED) for f in forces):
        return False
    return (forces is mech.forces or _are_same_kinds(mech.forces, forces)) and _are_alike(mech.model, model)


def _shared(mech: "Mechanism", parts: dict[str, Any]) -> "Mechanism":
    """Return a copy with other numbers of the model and its forces, start, duration or source."""
    rebound = "forces" in parts or "model" in parts
    if not rebound:
        _ = mech.row_scales, mech.q_scales, mech.coordinate_scales, mech.joint_names  # once for all variants
    out, kind = copy(mech), cast(Any, type(mech))
    for name in _cached_properties(kind).intersection(vars(out)):
        if rebound or name not in INDEPENDENT:
            del out.__dict__[name]
    vars(out).update({"start_values" if name == "start" else name: x for name, x in parts.items()})
    out.workspaces = mech.workspaces.of(out)
    if rebound:
        _rebind(out, mech, "model" in parts)
    if "start" in parts or out._positions is not mech._positions:
        out._starts = {}
    return out


def _rebind(out: "Mechanism", mech: "Mechanism", moved: bool) -> None:
    """Replace what depends on the numbers of forces, and of the model if they are other ones."""
    if moved:
        out.manifold = Manifold(out.model)
        out.closure_anchors = [(c, anchors(out.model, c)) for c, _ in mech.closure_anchors]
    elif [getattr(f, "frames", None) for f in out.forces] == [getattr(f, "frames", None) for f in mech.forces]:
        vars(out)["characteristic_length"] = mech.characteristic_length
    if moved or out.characteristic_length != mech.characteristic_length:
        out._positions = {}  # forces do not act on assembly
    out.states = bind_forces(out.forces, out.model, out.make_workspace()).states()


@cache
def _cached_properties(kind: Any) -> frozenset[str]:
    return frozenset(name for name in dir(kind) if isinstance(getattr(kind, name), cached_property))


def _are_same_kinds(before: Sequence[object], after: Sequence[object]) -> bool:
    """Return whether forces or rows have the same types and names, one by one."""
    kinds = [[(type(x), getattr(x, "name", "")) for x in part] for part in (before, after)]
    return kinds[0] == kinds[1]


def _are_alike(a: pin.Model, b: pin.Model) -> bool:
    """Return whether two models have the same joints and frames, with other numbers."""
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
