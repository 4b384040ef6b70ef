"""Modes and impacts of a run as columns over time."""

from typing import TYPE_CHECKING

import numpy as np

from ..mechanism.hybrid.kinds.unilateral import Unilateral
from ..mechanism.hybrid.mode_point import AllRows, ModePoint
from ..mechanism.hybrid.switch import Switch
from ..system import Array

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .solution import Solution


def _unilateral(mech: "Mechanism") -> list[Unilateral]:
    return [s for s in mech.switches if isinstance(s, Unilateral)]


def _impact_switches(mech: "Mechanism") -> list[Switch]:
    return [s for s in mech.switches if s.takes_impulse]


def mode_units(mech: "Mechanism") -> dict[str, str]:
    """Return names of the columns of `mode_columns`, and their units."""
    out = {f"gap.{s.name}": mech.row_units[s.row] for s in _unilateral(mech)}
    out |= {f"mode.{s.name}": "1" for s in mech.switches}
    return out | {
        f"impulse.{s.name}": "N s" if mech.row_units[s.row] == "m" else "N m s" for s in _impact_switches(mech)
    }


def mode_columns(sol: "Solution") -> dict[str, Array]:
    """Return ``gap.<name>`` of unilateral rows in m or rad, and ``mode.<name>``, the state index of a switch.

    Also ``impulse.<name>`` in N s or N m s of unilateral rows, clutches and drivers with speed steps: the impulse of an
    impact at this time, or 0.
    """
    mech = sol.mechanism
    unilateral = _unilateral(mech)
    nodes = np.arange(len(sol.t)) if sol.steps is None else sol.before(sol.t)
    idle = (0,) * len(mech.switches)
    modes = np.array([sol.mode(int(i)) or idle for i in nodes], int).reshape(len(nodes), -1)
    system, rows = sol.system, AllRows(sol.system)
    points = [ModePoint(system, rows, float(t), y) for t, y in zip(sol.t, sol.y, strict=True)]
    out = {f"gap.{s.name}": np.array([s.gap(p) for p in points]) for s in unilateral}
    out |= {f"mode.{s.name}": modes[:, s.index] for s in mech.switches}
    for s in _impact_switches(mech):
        column = out[f"impulse.{s.name}"] = np.zeros(len(sol.t))
        for x in sol.impacts:
            if s.name in x.where:
                column[int(np.abs(sol.t - x.t).argmin())] += x.impulse[x.where.index(s.name)]
    return out
