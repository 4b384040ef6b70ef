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
        slips: it is one of rows of velocity only, which do not open but slip.
    """

    name: str
    size: float
    text: str
    slips: bool = False

    def says(self, opens: str = "is open") -> str:
        """What is to be said of it: ``closure 'pin' is open by 0.1 m``."""
        return f"closure {self.name!r} {'slips' if self.slips else opens} by {self.text}"


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
    of_it = np.abs(np.where(owners == worst, residual, 0.0))
    slips = bool(per) and not mech.positional[int(of_it.argmax())]
    return ClosureError(worst, sizes[worst], " and ".join(parts) or "0", slips)
