"""Evaluation of a solution at many times."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..mechanism import Mechanism
from ..mechanism.formulations.slip_friction import has_slip_friction, with_slip_friction
from ..mechanism.formulations.steps.interpolation import can_sample_at_once, sample_at_once
from ..system import Array

if TYPE_CHECKING:
    from ..mechanism.formulations.index2 import Index2System
    from .solution import Solution


def split_by_rows(sol: "Solution", nodes: Array) -> list[Array]:
    """Split the indices of nodes (k,) of a solution by their rows in use."""
    if not len(nodes):
        return []
    set_index = np.searchsorted([first for first, _ in sol.in_use], nodes, side="right")
    return [np.flatnonzero(set_index == k) for k in np.unique(set_index)]


def derivatives_at_times(sol: "Solution") -> tuple[Array, Array]:
    """Return y' (n, ny) and multipliers (n, nz) at the times of a solution, see `Solution.derivatives`.

    For slipping joints and sliding no-slip rows, the multipliers are the friction forces.
    """
    F, z = (np.full((len(sol.t), width), np.nan) for width in (sol.system.ny, sol.system.nz))
    nodes = np.arange(len(sol.t)) if sol.steps is None else sol.before(sol.t)
    for group in split_by_rows(sol, nodes):
        system = sol.at(int(nodes[group[0]]))
        F[group], z[group] = system.derivatives(sol.t[group], sol.y[group], sol.z_own[group])
        if isinstance(sol.problem, Mechanism) and has_slip_friction(system):
            for i in group:
                q, v = system.split(sol.y[i])
                z[i, : system.ng] = with_slip_friction(system, q, v, z[i, : system.ng])
    return F, z


def set_slip_directions(system: "Index2System", ys: Iterable[Array]) -> None:
    """Set slip directions from the first of these points with slip: at the start of sliding they are undefined."""
    for y in ys:
        q, v = system.split(y)
        system.jacobian(q)
        if system.closure_friction.update_slip_directions(v):
            return


def residuals_and_energies(sol: "Solution") -> tuple[Array, Array, Array]:
    """Return g (n, ng), G v + g_t (n, ng) and energies (n, 2) at the times of a solution, each in its mode."""
    t, y = np.asarray(sol.t), np.asarray(sol.y)
    if not sol.modes:
        return sol.system.residuals(t, y)
    out = np.zeros((len(t), sol.mechanism.ng)), np.zeros((len(t), sol.mechanism.ng)), np.zeros((len(t), 2))
    nodes = np.arange(len(t)) if sol.steps is None else sol.before(t)
    for group in split_by_rows(sol, nodes):
        for values, computed in zip(out, sol.at(int(nodes[group[0]])).residuals(t[group], y[group]), strict=True):
            values[group] = computed
    return out


def sample_together(sol: Any, times: Array) -> Array | None:
    """Return y at all times, (n, ...), like `Solution.point`; None if the points must be computed one by one.

    Raises:
        StepError: for a point that cannot be computed.
    """
    ts, ys, zs = map(np.asarray, sol.nodes)
    if not isinstance(sol.problem, Mechanism) or len(ts) < 2 or len(times) < 2:
        return None
    if "dense_order" not in sol.settings:  # a study's sequence of poses, which has no values between its nodes
        return None
    if not can_sample_at_once(sol.system, sol.settings["dense_order"]):
        return None
    sign = 1.0 if ts[-1] > ts[0] else -1.0
    if not ((sign * times >= sign * ts[0]) & (sign * times <= sign * ts[-1])).all():
        return None  # `DenseOutput.point` reports the first one outside
    steps = np.minimum(sol.before(times), len(ts) - 2)
    used, step_of_time = np.unique(steps, return_inverse=True)
    if len(split_by_rows(sol, np.union1d(used, used + 1))) > 1:
        return None
    sol.at(int(used[0]))
    nodes = np.setdiff1d(np.union1d(used, used + 1), list(sol.rates))
    rates = sol.system.derivatives(ts[nodes], ys[nodes], zs[nodes])[0]
    sol.rates |= {int(i): F for i, F in zip(nodes, rates, strict=True) if not np.isnan(F).any()}
    starts, ends = (np.array([sol.rate(int(i)) for i in nodes]) for nodes in (used, used + 1))
    h, theta = ts[used + 1] - ts[used], (times - ts[steps]) / (ts[steps + 1] - ts[steps])
    out = sample_at_once(sol.system, ts[used], h, (ys[used], ys[used + 1]), (starts, ends), step_of_time, theta)
    for node, coincident in ((steps, (times == ts[steps]) | sol.jumped()[steps]), (steps + 1, times == ts[steps + 1])):
        out[coincident] = ys[node[coincident]]
    return out
