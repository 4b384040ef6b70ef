"""Reasons not to trust a run that came to its end: loops far open, rows that are not kept, energy that is lost."""

import numpy as np

from ..mechanism.closures.closure_error import largest_error
from ..mechanism.formulations.index2 import Index2System
from ..solution.columns import balance
from ..solution.solution import Solution

OPEN = 0.01  # rad, or of a length: what would have to move by as much to close the loops
SLIPPING = 1e-6  # |G v + g_t| over all rows, of 1 + |v|
LOST = 0.1  # of the energy that moves
SAMPLES = 8  # steps at which the energy is looked at


def doubts(sol: Solution, system: Index2System) -> str:
    """Say in words what speaks against a run, and what to do; empty for nothing.

    Args:
        sol: a run of a mechanism to its end.
        system: its workspace, which has seen all rows at the ends of all steps.
    """
    formulation, mech = sol.settings["formulation"], sol.mechanism
    ts, ys, _ = sol.nodes
    q, v = system.split(ys[-1])
    found = []
    if system.ng:
        g, G = system.closures(q, ts[-1])
        if not system.largest_g <= OPEN * (reach := float(np.abs(G).max())):
            which = largest_error(mech, g)
            opened = f"closures stood open by {system.largest_g:.2g}, on arms of {reach:.2g} m"
            found.append(f"{opened} ({which.name!r} by {which.text} at the end)")
        if formulation != "index1" and not system.largest_rate <= SLIPPING:
            which = largest_error(mech, G @ v + system.g_t(ts[-1]), "/s")
            slipped = f"rows that depended on others are not kept: |G v| reached {system.largest_rate:.2g} (1 + |v|)"
            found.append(f"{slipped} ({which.name!r} {'slips' if which.slips else 'opens'} by {which.text} at the end)")
    lost = _lost(sol, system)
    if not lost <= LOST:
        found.append(f"the energy balance is lost: {lost:.2g} of the energy that moves")
    if not found:
        return ""
    fixed, kept = "step" in sol.settings, sol.settings["project"] or formulation == "ggl" or not system.ng
    return f"{'; '.join(found)}: take a smaller {'step' if fixed else 'rtol'}{'' if kept else ', or project=True'}"


def _lost(sol: Solution, system: Index2System) -> float:
    """Largest |E - E_0 - W| at some steps over the largest of |W|, kinetic energy and the range of potential energy."""
    ys = sol.nodes[1]
    some = ys[np.unique(np.linspace(0, len(ys) - 1, SAMPLES + 1).astype(int))]
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic, potential = np.array([system.energy(*system.split(y)) for y in some]).T
        error, scale = balance(some[:, system.nq : system.nq + system.nv], kinetic, potential, some[:, -1])
    return float(error.max() / scale) if scale else 0.0
