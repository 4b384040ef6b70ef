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
        relative: the same with lengths in characteristic lengths of the mechanism, of all the largest.
        text: the residual with units, lengths apart from angles.
        slips: it is one of rows of velocity only, which do not open but slip.
    """

    name: str
    size: float
    relative: float
    text: str
    slips: bool = False

    def says(self, opens: str = "is open") -> str:
        """What is to be said of it: ``closure 'pin' is open by 0.1 m``."""
        return f"closure {self.name!r} {'slips' if self.slips else opens} by {self.text}"


def largest_error(mech: "Mechanism", residual: Array, per: str = "") -> ClosureError:
    """Return the closure or driver with the largest residual (ng,); ``per`` follows the units, for instance "/s"."""
    scaled = residual / mech.row_scales
    sizes = {c.name: float(np.linalg.norm(scaled[mech.rows_of(c.name)])) for c in mech.constraints}
    worst = max(sizes, key=lambda n: sizes[n] if np.isfinite(sizes[n]) else np.inf)
    rows = mech.rows_of(worst)
    of_it, units = residual[rows], mech.row_units[rows]
    parts = [
        f"{size:.3g} {unit}{per}"
        for unit in dict.fromkeys(units)
        if (size := float(np.linalg.norm(of_it[units == unit])))
    ]
    slips = bool(per) and not mech.positional[rows[int(np.abs(of_it).argmax())]]
    return ClosureError(worst, float(np.linalg.norm(of_it)), sizes[worst], " and ".join(parts) or "0", slips)
