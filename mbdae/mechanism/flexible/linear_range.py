"""Range of linear modes: deflections and rotations that they represent accurately."""

from collections.abc import Iterator

import pinocchio as pin

from ...system import Array
from ..tree.tree_terms import flexible_bodies

MAX_DEFLECTION = 0.1  # fraction of the size of a body: its square is the relative error of a linear deformation
MAX_ROTATION = 0.3  # rad: sine and angle differ by 1.5 %


def beyond_linear(model: pin.Model, q: Array) -> str:
    """Return which flexible body bends beyond the range of linear modes, and by how much; empty if none does.

    Args:
        model: a model.
        q: configurations, (n, nq).
    """
    found = []
    for name, deflection, rotation, size in _motions(model, q):
        if (deflection > MAX_DEFLECTION * size > 0) or rotation > MAX_ROTATION:
            amount = f"{deflection:.2g} m of {size:.2g} m, {rotation:.2g} rad"
            found.append(f"{name} bends beyond the range of linear modes, by {amount}")
    return "; ".join(found)


def deflection_exceeds_size(model: pin.Model, q: Array) -> bool:
    """Return whether the deflection of a flexible body is larger than the body: linear modes have no meaning there.

    Args:
        model: a model.
        q: a configuration, (nq,).
    """
    return any(deflection > size > 0 for _, deflection, _, size in _motions(model, q[None]))


def _motions(model: pin.Model, q: Array) -> Iterator[tuple[str, float, float, float]]:
    """Yield name, largest deflection, largest rotation and size of each flexible body."""
    for body in flexible_bodies(model):
        modal, first = body.modal, body.first_mode_joint(model).idx_q
        yield body.name, *modal.largest_motion(q[:, first : first + modal.modes]), modal.size
