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
        vibrations: vibrations of its flexible bodies.
    """
    errors = [text for check in CHECKS if (text := check(sol, system))]
    warnings = [text for check in ASSUMPTIONS if (text := check(sol, system))]
    if errors:
        warnings.insert(0, f"{'; '.join(errors)}: {_remedy(sol, system)}")
    if vibrations and (unresolved := unresolved_vibrations(sol, vibrations)):
        warnings.append(unresolved)
    return "; ".join(warnings)


def _remedy(sol: Solution, system: Index2System) -> str:
    """Return how to make a run more accurate, or which contradicting rows make that impossible."""
    if names := contradicting_rows(system, sol.nodes[0][-1], sol.nodes[1][-1]):
        return f"{names} contradict each other"
    is_fixed, formulation = "step" in sol.settings, sol.settings["formulation"]
    is_projected = sol.settings["project"] or formulation == "ggl" or not system.ng or sol.settings["method"] in SOLVERS
    return f"take a smaller {'step' if is_fixed else 'rtol'}{'' if is_projected else ', or project=True'}"


def violated_closures(sol: Solution, system: Index2System) -> str:
    """Return which closure was violated by more than `POSITION_TOLERANCE`; empty if none."""
    if system.largest_g <= POSITION_TOLERANCE:
        return ""
    mech, t, q = sol.mechanism, sol.nodes[0][-1], system.split(sol.nodes[1][-1])[0]
    worst = largest_error(mech, system.closures(q, t)[0])
    size = f"{system.largest_g:.2g} rad or characteristic lengths of {mech.characteristic_length:.3g} m"
    return f"closures were violated by {size} ({worst.name!r} by {worst.text} at the end)"


def violated_velocity_rows(sol: Solution, system: Index2System) -> str:
    """Return which row was violated at velocity level, and whether only redundant rows were; empty if none."""
    slip = 0.0 if sol.settings["formulation"] == "index1" else _largest_slip(system)
    if slip <= VISIBLE:
        return ""
    t, (q, v) = sol.nodes[0][-1], system.split(sol.nodes[1][-1])
    rates = system.closures(q, t)[1] @ v + system.g_t(t)
    worst = largest_error(sol.mechanism, rates, "/s")
    sizes = np.abs(rates / sol.mechanism.row_scales)
    used = list(sol.in_use[-1][1]) if sol.in_use else slice(None)
    rows = "rows" if sizes[used].max() > NEGLIGIBLE * sizes.max() else "rows that depended on others"
    message = f"{rows} are not satisfied: |G v| reached {slip:.2g} of the largest speeds"
    return f"{message} ({worst.name!r} {'slips' if worst.velocity_only else 'is violated'} by {worst.text} at the end)"


def energy_imbalance(sol: Solution, system: Index2System) -> str:
    """Return the violation of the energy balance if it exceeds `ENERGY_TOLERANCE`; else empty."""
    ts, ys, _ = sol.nodes
    nodes = _evenly_spaced(len(ys), SAMPLES + 1)
    points = ys[nodes]
    energies = system.residuals(ts[nodes], points)[2]
    pairs = energies.tolist()  # lists are faster than short arrays
    balance = [T + U - work for (T, U), work in zip(pairs, points[:, -1].tolist(), strict=True)]
    if isfinite(sum(balance)) and max(balance) - min(balance) <= ENERGY_TOLERANCE * max(T for T, _ in pairs):
        return ""  # at most the energy exchanged
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic, potential = energies.T
        error, exchanged = energy_balance(sol, kinetic, potential, points[:, -1])
        relative = float(np.abs(error).max() / exchanged) if exchanged else 0.0
    if relative <= ENERGY_TOLERANCE:
        return ""
    return f"the energy balance is violated by {relative:.2g} of the energy exchanged"


def lost_preconditions(sol: Solution, system: Index2System) -> str:
    """Return which closure lost a precondition, and when; empty if none."""
    ts, ys, _ = sol.nodes
    nodes = _evenly_spaced(len(ts), PRECONDITION_NODES)
    return precondition_violation(system, ts[nodes], ys[nodes, : system.nq])


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
    size, residual = np.linalg.norm(G, axis=1).max(), np.linalg.norm(G - G @ Q @ Q.T, axis=1)
    if not residual.max() > AMBIGUOUS_PIVOT * size:
        return ""
    name = sol.mechanism.row_names[int(residual.argmax())]
    return f"{name!r} depended on other closures at the start and does not now: they cannot all be satisfied in motion"


def lift_off(sol: Solution, system: Index2System) -> str:
    """Return which rolling bodies would separate from a surface that holds them, and when; empty if none.

    The multipliers of the method select candidates; those of the hidden constraint decide.
    """
    mech, (ts, _, zs) = sol.mechanism, sol.nodes
    messages, switched = [], {row for s in mech.switches for row in s.rows}
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
            messages.append(
                f"{closure.name!r} is held on its surface from t = {start:.6g} s on, where N < 0: it would separate"
            )
    return "; ".join(messages)


def large_deflections(sol: Solution, system: Index2System) -> str:
    """Return which flexible body bends beyond the range of linear modes; empty if none does."""
    return beyond_linear(system.model, sol.nodes[1][:, : system.nq])


def are_accurate(extremes: Array, energies: Array, work: Array) -> Array:
    """Return whether runs pass `CHECKS`, (k,); where they hardly move, some may count as inaccurate.

    Args:
        extremes: largest |g|, |G v + g_t| and |v| at the ends of steps, (k, 3), see `Index2System`.
        energies: kinetic and potential energies at `SAMPLES` + 1 nodes of each run in J, (k, n, 2).
        work: work at these nodes in J, (k, n).
    """
    g, slip, speed = extremes.T
    with np.errstate(over="ignore", invalid="ignore"):
        error, scale = energy_error(energies[..., 0], energies[..., 1], work)
        balanced = np.abs(error).max(-1) <= ENERGY_TOLERANCE * scale
    return (g <= POSITION_TOLERANCE) & (slip <= VISIBLE * speed) & balanced


def _evenly_spaced(n: int, count: int) -> Array | slice:
    """Return the indices of at most ``count`` of n nodes, evenly spaced from the first to the last."""
    return slice(None) if n <= count else np.linspace(0, n - 1, count).astype(int)


CHECKS: Sequence[Check] = violated_closures, violated_velocity_rows, energy_imbalance  # remedied by a higher accuracy
ASSUMPTIONS: Sequence[Check] = dependent_rows_changed, lift_off, lost_preconditions, large_deflections, skipped_shape
