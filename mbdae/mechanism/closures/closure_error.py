"""Constraint violation of closures, in the units of their rows, and its description in messages."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...system import Array
from ...units import quantity
from ..tree.tree_terms import flexible_bodies

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class ClosureError(NamedTuple):
    """Closure or driver with the largest violation.

    Attributes:
        name: name of the closure or driver.
        size: norm of its residual, in the units of its rows.
        relative: the same norm with lengths in characteristic lengths of the mechanism, the largest of all closures.
        text: residual with units, lengths and angles separately.
        velocity_only: whether the largest residual is that of a velocity row, which slips and has no g.
    """

    name: str
    size: float
    relative: float
    text: str
    velocity_only: bool = False

    def message(self) -> str:
        """Return the description: ``closure 'pin' is violated by 0.1 m``."""
        return f"closure {self.name!r} {'slips' if self.velocity_only else 'is violated'} by {self.text}"


def largest_error(mech: "Mechanism", residual: Array, per: str = "") -> ClosureError:
    """Return the closure or driver with the largest residual (ng,); ``per`` follows the units, for instance "/s"."""
    scaled = residual / mech.row_scales
    sizes = {c.name: float(np.linalg.norm(scaled[mech.rows_of(c.name)])) for c in mech.constraints}
    worst = max(sizes, key=lambda n: sizes[n] if np.isfinite(sizes[n]) else np.inf)
    rows = mech.rows_of(worst)
    x, units = residual[rows], mech.row_units[rows]
    terms = [
        quantity(size, f"{unit}{per}", ".3g")
        for unit in dict.fromkeys(units)
        if (size := float(np.linalg.norm(x[units == unit])))
    ]
    velocity_only = bool(per) and not mech.positional[rows[int(np.abs(x).argmax())]]
    return ClosureError(worst, float(np.linalg.norm(x)), sizes[worst], " and ".join(terms) or "0", velocity_only)


def shortening_remark(mech: "Mechanism", name: str) -> str:
    """Return a remark on a closure that the shortening of a beam violates; empty if it does not connect such a beam."""
    frames = {frame for c in mech.closures if c.name == name for frame in c.frames or ()}
    for body in flexible_bodies(mech.model):
        nodes = zip(body.node_frames, body.modal.nodes.values(), strict=True)
        if any(frame in frames and node.Phi2 is not None for frame, node in nodes):
            remedy = "let an end slide, or take stiffening = false, or axial = true with a mode that stretches it"
            return f"; bending shortens {body.name!r}: {remedy}"
    return ""
