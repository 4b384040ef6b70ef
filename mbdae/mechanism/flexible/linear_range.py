"""Range of linear modes: deflections and rotations that they describe."""

import pinocchio as pin

from ...system import Array
from ..tree.frames import find_joint
from ..tree.tree_terms import flexible_bodies

MAX_DEFLECTION = 0.1  # of the size of a body: its square is the relative error of a linear deformation
MAX_ROTATION = 0.3  # rad: sine and angle differ by a fiftieth


def beyond_linear(model: pin.Model, q: Array) -> str:
    """Return which flexible body bends beyond the range of linear modes, and by how much; empty if none does.

    Args:
        model: a model.
        q: configurations, (n, nq).
    """
    found = []
    for body in flexible_bodies(model):
        modal, first = body.modal, find_joint(model, body.mode_joints[0]).idx_q
        (deflection, rotation), size = modal.largest_motion(q[:, first : first + modal.modes]), modal.size
        if (deflection > MAX_DEFLECTION * size > 0) or rotation > MAX_ROTATION:
            amount = f"{deflection:.2g} m of {size:.2g} m, {rotation:.2g} rad"
            found.append(f"{body.name} bends beyond the range of linear modes, by {amount}")
    return "; ".join(found)
