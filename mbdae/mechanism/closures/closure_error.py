"""How far closures are open, row by row in the rows' own units, and the words for it."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...system import Array

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class ClosureError(NamedTuple):
    """The closure or driver that is open the most.

    Attributes:
        name: its name.
        size: norm of its residual.
        text: the residual with units, lengths apart from angles.
    """

    name: str
    size: float
    text: str


def largest_error(mech: "Mechanism", residual: Array, per: str = "") -> ClosureError:
    """Return the closure or driver with the largest residual (ng,); ``per`` follows the units, for instance "/s"."""
    owners, units = np.array(mech.row_names), mech.row_units
    sizes = {c.name: float(np.linalg.norm(residual[owners == c.name])) for c in mech.constraints}
    worst = max(sizes, key=lambda n: sizes[n] if np.isfinite(sizes[n]) else np.inf)
    parts = [
        f"{size:.3g} {unit}{per}"
        for unit in dict.fromkeys(units[owners == worst])
        if (size := float(np.linalg.norm(residual[(owners == worst) & (units == unit)])))
    ]
    return ClosureError(worst, sizes[worst], " and ".join(parts) or "0")
