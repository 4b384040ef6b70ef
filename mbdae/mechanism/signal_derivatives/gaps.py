"""Derivatives of the gaps of unilateral rows."""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ..discrete_sensitivity.impact_sensitivity import row_rate_partials
from ..hybrid.kinds.unilateral import Unilateral
from ..tree.tree_terms import update_motions, update_poses
from .motion_tangent import MotionTangent

if TYPE_CHECKING:
    from ..mechanism import Mechanism


def unilateral_rows(mech: "Mechanism") -> dict[str, Unilateral]:
    """Return the unilateral rows of a mechanism by the names of their gaps."""
    return {f"gap.{s.name}": s for s in mech.switches if isinstance(s, Unilateral)}


def gap_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives of the gaps of all unilateral rows, open or closed, (n, m)."""
    s, d = motion.system, motion.d
    g = row_rate_partials(motion.parameters, motion.t, motion.q, motion.v)[0]
    update_motions(s.model, s.workspace, motion.q, motion.v, np.zeros(len(motion.v)))
    update_poses(s.model, s.workspace, motion.q)
    rows = list(unilateral_rows(s.mechanism).values())
    signs = np.array([[switch.sign] for switch in rows])
    return np.asarray(signs * g[[switch.row for switch in rows]] @ np.vstack([d.q, d.v, d.p, d.t]))
