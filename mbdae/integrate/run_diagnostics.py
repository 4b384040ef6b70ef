"""Post-run accuracy checks: constraint violation, drift of redundant rows, energy balance, contact separation."""

import numpy as np

from ..mechanism.closures.closure_error import largest_error
from ..mechanism.closures.preconditions import lost_precondition
from ..mechanism.contacts import first_negative, rolling
from ..mechanism.formulations.index2 import Index2System
from ..mechanism.formulations.projection import VELOCITY_TOLERANCE, contradictions
from ..mechanism.reactions import scaled
from ..solution.columns import balance
from ..solution.solution import Solution

POSITION_TOLERANCE = 0.01  # rad or characteristic lengths
ENERGY_TOLERANCE = 0.1  # of the energy that moves
LIFT_OFF_TOLERANCE = 1e-6  # of the largest N: smaller negative values count as 0
DEPENDENCE_TOLERANCE = 1e-5  # of the largest row: projected rows with a smaller remainder are dependent
SAMPLES = 8  # steps at which the energy is computed
WATCHED = 400  # nodes at which preconditions of closures are checked


def accuracy_warnings(sol: Solution, system: Index2System) -> str:
    """Return accuracy warnings of a run, with remedies; empty if there are none.

    Args:
        sol: a run of a mechanism to its end.
        system: its workspace, with records of all rows at the ends of all steps.
    """
    ts, ys, _ = sol.nodes
    found = _constraint_violations(sol, system) if system.ng else []
    names = contradictions(system, ts[-1], ys[-1]) if found else ""
    lost = relative_energy_error(sol, system)
    if not lost <= ENERGY_TOLERANCE:
        found.append(f"the energy balance is lost: {lost:.2g} of the energy that moves")
    some = np.unique(np.linspace(0, len(ts) - 1, WATCHED).astype(int))
    unfit = lost_precondition(system, ts[some], ys[some, : system.nq])
    more = [text for text in (dependent_rows_changed(sol, system), lift_off(sol), unfit) if text]
    if not found:
        return "; ".join(more)
    fixed, formulation = "step" in sol.settings, sol.settings["formulation"]
    kept = sol.settings["project"] or formulation == "ggl" or not system.ng
    advice = f"take a smaller {'step' if fixed else 'rtol'}{'' if kept else ', or project=True'}"
    why = f"{names} contradict each other" if names else advice
    return "; ".join([f"{'; '.join(found)}: {why}", *more])


def _constraint_violations(sol: Solution, system: Index2System) -> list[str]:
    """Return which closures were violated, and which rows that depended on others are not kept."""
    slip = 0.0 if sol.settings["formulation"] == "index1" else _largest_slip(system)
    if system.largest_g <= POSITION_TOLERANCE and slip <= VELOCITY_TOLERANCE:
        return []
    mech, found, t, (q, v) = sol.mechanism, list[str](), sol.nodes[0][-1], system.split(sol.nodes[1][-1])
    g, G = system.closures(q, t)
    if not system.largest_g <= POSITION_TOLERANCE:
        which = largest_error(mech, g)
        size = f"{system.largest_g:.2g} rad or characteristic lengths of {mech.characteristic_length:.3g} m"
        found.append(f"closures were violated by {size} ({which.name!r} by {which.text} at the end)")
    if not slip <= VELOCITY_TOLERANCE:
        which = largest_error(mech, G @ v + system.g_t(t), "/s")
        slipped = f"rows that depended on others are not kept: |G v| reached {slip:.2g} of the largest speeds"
        found.append(f"{slipped} ({which.name!r} {'slips' if which.slips else 'opens'} by {which.text} at the end)")
    return found


def _largest_slip(system: Index2System) -> float:
    """Return |G v + g_t| over all rows, of the largest speeds; the characteristic rate is added where nothing moves."""
    slip, speed = system.largest_rate, system.largest_speed
    return slip / (speed + system.mechanism.characteristic_rate) if not slip <= VELOCITY_TOLERANCE * speed else 0.0


def dependent_rows_changed(sol: Solution, system: Index2System) -> str:
    """Return which closure was redundant at the start, but not at the end of a projected run; empty if none.

    An example is wheels that steer in parallel: projection then closes all rows, which blocks a motion.
    """
    used = list(sol.in_use[-1][1]) if sol.in_use else []
    if not sol.settings["project"] or not 0 < len(used) < system.ng:
        return ""
    ts, ys, _ = sol.nodes
    G = scaled(system, ts[-1], system.split(ys[-1])[0])
    Q = np.linalg.qr(G[used].T)[0]
    size, left = np.linalg.norm(G, axis=1).max(), np.linalg.norm(G - G @ Q @ Q.T, axis=1)
    if not left.max() > DEPENDENCE_TOLERANCE * size:
        return ""
    name = sol.mechanism.row_names[int(left.argmax())]
    return f"{name!r} depended on other closures at the start and does not now: they cannot all be kept while it moves"


def lift_off(sol: Solution) -> str:
    """Return which rolling bodies separate from their surface, and when; empty if none.

    The method's multipliers select candidates, those of the hidden constraint decide.
    """
    mech, (ts, _, zs) = sol.mechanism, sol.nodes
    found = []
    for closure in rolling(mech):
        row = mech.rows_of(closure.name)[0]
        if closure.contact is False or not (zs[1:, row] < 0).any():
            continue
        normal = zs[:, row].copy()
        for i in np.flatnonzero(~(normal >= 0)):
            normal[i] = sol.multipliers(ts[i])[row]
            if i and normal[i] < 0:
                normal[i - 1] = sol.multipliers(ts[i - 1])[row]
                break
        start = first_negative(ts, normal)
        if start is not None and normal.min() < -LIFT_OFF_TOLERANCE * np.abs(normal).max():
            found.append(
                f"{closure.name!r} is held on its surface from t = {start:.6g} s on, where N < 0: it would separate"
            )
    return "; ".join(found)


def relative_energy_error(sol: Solution, system: Index2System) -> float:
    """Return the largest |E - E_0 - W| at some steps, relative to |W|, kinetic energy and potential energy range."""
    ts, ys, _ = sol.nodes
    at = np.unique(np.linspace(0, len(ys) - 1, SAMPLES + 1).astype(int))
    times, some = ts[at], ys[at]
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic, potential = system.residuals(times, some)[2].T
        v = some[:, system.nq : system.nq + system.nv]
        error, scale = balance(system.mechanism, v, kinetic, potential, some[:, -1])
    return float(error.max() / scale) if scale else 0.0
