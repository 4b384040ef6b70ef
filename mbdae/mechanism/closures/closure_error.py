"""How far closures are open, in metres and radians, and the words for it."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..frames import find_joint
from ..joints import subspace
from .rows import Axes, Coordinate

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class Gap(NamedTuple):
    """The closure or driver that is open the most.

    Attributes:
        name: its name.
        size: norm of its residual.
        text: the residual with units, lengths apart from angles.
    """

    name: str
    size: float
    text: str


def widest(mech: "Mechanism", residual: np.ndarray, per: str = "") -> Gap:
    """Return the closure or driver with the largest residual (ng,); ``per`` follows the units, for instance "/s"."""
    owners, lengths = np.array(mech.row_names), length_rows(mech)
    sizes = {c.name: float(np.linalg.norm(residual[owners == c.name])) for c in mech.constraints}
    worst = max(sizes, key=lambda n: sizes[n] if np.isfinite(sizes[n]) else np.inf)
    parts = [
        f"{size:.3g} {unit}{per}"
        for unit, rows in (("m", lengths), ("rad", ~lengths))
        if (size := float(np.linalg.norm(residual[(owners == worst) & rows])))
    ]
    return Gap(worst, sizes[worst], " and ".join(parts) or "0")


def length_rows(mech: "Mechanism") -> np.ndarray:
    """Which rows are measured in metres, (ng,): gaps, distances, and coordinates of sliding joints."""
    out: list[bool] = []
    for spec in mech.constraints:
        for r in spec.rows():
            if isinstance(r, Coordinate):
                out.append(not subspace(find_joint(mech.model, r.joint))[3:].any())
            else:
                out += [not isinstance(r, Axes)] * r.m
    return np.array(out, bool)
