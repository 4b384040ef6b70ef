"""Post-run accuracy checks: constraints, redundant rows, energy, contacts, preconditions, flexible bodies."""

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np

from ...mechanism.closures.closure_error import largest_error
from ...mechanism.closures.preconditions import precondition_violation
from ...mechanism.flexible.linear_range import beyond_linear
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.formulations.steps.projection import contradicting_rows
from ...mechanism.signals.contacts import first_negative, rolling_closures
from ...mechanism.signals.reactions import mass_scaled_jacobian
from ...solution.columns import energy_balance, energy_error
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import AMBIGUOUS_PIVOT, NEGLIGIBLE, VISIBLE
from ..steppers.solvers import SOLVERS
from .elastic_resolution import Vibrations, unresolved_vibrations
from .skipped_shapes import skipped_shape

Check = Callable[[Solution, Index2System], str]

POSITION_TOLERANCE = 0.01  # rad or characteristic lengths
ENERGY_TOLERANCE = 0.1  # fraction of the energy that is exchanged
SAMPLES = 8  # steps at which the energy is computed
PRECONDITION_NODES = 400  # nodes at which preconditions of closures are checked


def accuracy_warnings(sol: Solution, system: Index2System, vibrations: Vibrations | None) -> str:
    """Return accuracy warnings of a run, with remedies; empty if there are none.

    Args:
        sol: a finished run of a mechanism.
        system: its workspace, which recorded the residuals of all rows at the ends of all steps.
        vibrations: those of its flexible bodies.
    """
    inaccurate = [text for check in CHECKS if (text := check(sol, system))]
    others = [text for check in ASSUMPTIONS if (text := check(sol, system))]
    if inaccurate:
        others.insert(0, f"{'; '.join(inaccurate)}: {_remedy(sol, system)}")
    if vibrations and (unresolved := unresolved_vibrations(sol, vibrations)):
        others.append(unresolved)
    return "; ".join(others)


def _remedy(sol: Solution, system: Index2System) -> str:
    """Return how to make a run more accurate, or which rows make that impossible."""
    if names := contradicting_rows(system, sol.nodes[0][-1], sol.nodes[1][-1]):
        return f"{names} contradict each other"
    fixed, formulation = "step" in sol.settings, sol.settings["formulation"]
    closed = sol.settings["project"] or formulation == "ggl" or not system.ng or sol.settings["method"] in SOLVERS
    return f"take a smaller {'step' if fixed else 'rtol'}{'' if closed else ', or project=True'}"


def violated_closures(sol: Solution, system: Index2System) -> str:
    """Return which closure was violated by more than `POSITION_TOLERANCE`; empty if none."""
    if system.largest_g <= POSITION_TOLERANCE:
        return ""
    mech, t, q = sol.mechanism, sol.nodes[0][-1], system.split(sol.nodes[1][-1])[0]
    which = largest_error(mech, system.closures(q, t)[0])
    size = f"{system.largest_g:.2g} rad or characteristic lengths of {mech.characteristic_length:.3g} m"
    return f"closures were violated by {size} ({which.name!r} by {which.text} at the end)"


def violated_velocity_rows(sol: Solution, system: Index2System) -> str:
    """Return which row was violated at velocity level, and whether redundant ones alone were; empty if none."""
    slip = 0.0 if sol.settings["formulation"] == "index1" else _largest_slip(system)
    if slip <= VISIBLE:
        return ""
    t, (q, v) = sol.nodes[0][-1], system.split(sol.nodes[1][-1])
    rates = system.closures(q, t)[1] @ v + system.g_t(t)
    which = largest_error(sol.mechanism, rates, "/s")
    sizes = np.abs(rates / sol.mechanism.row_scales)
    used = list(sol.in_use[-1][1]) if sol.in_use else slice(None)
    rows = "rows" if sizes[used].max() > NEGLIGIBLE * sizes.max() else "rows that depended on others"
    slipped = f"{rows} are not kept: |G v| reached {slip:.2g} of the largest speeds"
    return f"{slipped} ({which.name!r} {'slips' if which.velocity_only else 'is violated'} by {which.text} at the end)"


def energy_imbalance(sol: Solution, system: Index2System) -> str:
    """Return by how much the energy balance is violated, if by more than `ENERGY_TOLERANCE`; else empty."""
    ts, ys, _ = sol.nodes
    at = _spread(len(ys), SAMPLES + 1)
    some = ys[at]
    energies = system.residuals(ts[at], some)[2]
    few = energies.tolist()  # lists are faster than arrays of some nodes
    balance = [T + U - work for (T, U), work in zip(few, some[:, -1].tolist(), strict=True)]
    if isfinite(sum(balance)) and max(balance) - min(balance) <= ENERGY_TOLERANCE * max(T for T, _ in few):
        return ""  # at most the energy exchanged
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic, potential = energies.T
        error, exchanged = energy_balance(sol, kinetic, potential, some[:, -1])
        relative = float(np.abs(error).max() / exchanged) if exchanged else 0.0
    if relative <= ENERGY_TOLERANCE:
        return ""
    return f"the energy balance is violated by {relative:.2g} of the energy exchanged"


def lost_preconditions(sol: Solution, system: Index2System) -> str:
    """Return which closure lost a precondition, and when; empty if none."""
    ts, ys, _ = sol.nodes
    some = _spread(len(ts), PRECONDITION_NODES)
    return precondition_violation(system, ts[some], ys[some, : system.nq])


def _largest_slip(system: Index2System) -> float:
    """Return |G v + g_t| over all rows relative to the largest speeds; at rest, to the characteristic rate."""
    slip, speed = system.largest_rate, system.largest_speed
    return slip / (speed + system.mechanism.characteristic_rate) if not slip <= VISIBLE * speed else 0.0


def dependent_rows_changed(sol: Solution, system: Index2System) -> str:
    """Return which closure was redundant at the start, but is not at the end of a projected run; empty if none.

    An example is wheels that steer in parallel: the projection satisfies all rows, which blocks a motion.
    """
    used = list(sol.in_use[-1][1]) if sol.in_use else []
    if not sol.settings["project"] or not 0 < len(used) < system.ng:
        return ""
    ts, ys, _ = sol.nodes
    if system.remaining_rows_dependent(ts[-1], ys[-1]):
        return ""
    G = mass_scaled_jacobian(system, ts[-1], system.split(ys[-1])[0])
    Q = np.linalg.qr(G[used].T)[0]
    size, left = np.linalg.norm(G, axis=1).max(), np.linalg.norm(G - G @ Q @ Q.T, axis=1)
    if not left.max() > AMBIGUOUS_PIVOT * size:
        return ""
    name = sol.mechanism.row_names[int(left.argmax())]
    return f"{name!r} depended on other closures at the start and does not now: they cannot all be kept while it moves"


def lift_off(sol: Solution, system: Index2System) -> str:
    """Return which rolling bodies would separate from a surface that holds them, and when; empty if none.

    The multipliers of the method select candidates; those of the hidden constraint decide.
    """
    mech, (ts, _, zs) = sol.mechanism, sol.nodes
    found, switched = [], {row for s in mech.switches for row in s.rows}
    for closure in rolling_closures(mech):
        row = mech.rows_of(closure.name)[0]
        if closure.contact is False or row in switched or not (zs[1:, row] < 0).any():
            continue
        normal = zs[:, row].copy()
        for i in np.flatnonzero(~(normal >= 0)):
            normal[i] = sol.multipliers(ts[i])[row]
            if i and normal[i] < 0:
                normal[i - 1] = sol.multipliers(ts[i - 1])[row]
                break
        start = first_negative(ts, normal)
        if start is not None:
            found.append(
                f"{closure.name!r} is held on its surface from t = {start:.6g} s on, where N < 0: it would separate"
            )
    return "; ".join(found)


def large_deflections(sol: Solution, system: Index2System) -> str:
    """Return which flexible body bends beyond the range of linear modes; empty if none does."""
    return beyond_linear(system.model, sol.nodes[1][:, : system.nq])


def are_accurate(extremes: Array, energies: Array, work: Array) -> Array:
    """Return whether runs pass `CHECKS`, (k,); where they hardly move, some may count as inaccurate.

    Args:
        extremes: largest |g|, |G v + g_t| and |v| at the ends of steps, (k, 3), see `Index2System`.
        energies: kinetic and potential energies at `SAMPLES` + 1 nodes of each run in J, (k, n, 2).
        work: work there in J, (k, n).
    """
    g, slip, speed = extremes.T
    with np.errstate(over="ignore", invalid="ignore"):
        error, scale = energy_error(energies[..., 0], energies[..., 1], work)
        balanced = np.abs(error).max(-1) <= ENERGY_TOLERANCE * scale
    return (g <= POSITION_TOLERANCE) & (slip <= VISIBLE * speed) & balanced


def _spread(n: int, most: int) -> Array | slice:
    """Return indices of n nodes, evenly spread from the first to the last, at most so many."""
    return slice(None) if n <= most else np.linspace(0, n - 1, most).astype(int)


CHECKS: Sequence[Check] = violated_closures, violated_velocity_rows, energy_imbalance  # a higher accuracy is the remedy
ASSUMPTIONS: Sequence[Check] = dependent_rows_changed, lift_off, lost_preconditions, large_deflections, skipped_shape
