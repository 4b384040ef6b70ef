"""Adjoint sweep along a run: cotangents of its nodes from costs of signals."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...integrate.trajectory.native_trajectory import NodeRange
from ...integrate.trajectory.signal_jacobian import SignalJacobian
from ...integrate.trajectory.trajectory import Trajectory, TrajectoryPart
from ...system import Array
from .terminal_event import EventTimeDerivative

Cotangents = tuple[Array, Array, Array]  # of (y, carry) (costs, ny + nc), of parameters (costs, k), of time (costs,)


class NodeCotangents:
    """Cotangents of the nodes of a run from costs of signals.

    Args:
        trajectory: the run.
        t: times, (n,).
        points: the points at these times, (n, ...).
        weights: for each cost the derivatives with respect to signals by name, (n,) each.
    """

    def __init__(self, trajectory: Trajectory, t: Array, points: Array, weights: Sequence[Mapping[str, Array]]) -> None:
        self.trajectory, self.t, self.points = trajectory, t, points
        names = list(dict.fromkeys(name for cost in weights for name in cost))
        self.signals, zero = SignalJacobian(trajectory, names), np.zeros(len(t))
        rows = [[cost.get(name, zero) for name in names] for cost in weights]
        self.weights = np.array(rows).reshape(len(weights), len(names), len(t))
        self.nodes = trajectory.sol.before(t) if trajectory.sol.steps else np.arange(len(t))
        self.bounds = np.searchsorted(self.nodes, np.arange(len(trajectory.ts) + 1))
        self.at_nodes = trajectory.ts[self.nodes] == t
        self.used = np.asarray(self.weights.any(axis=(0, 1)))

    def of_node(self, i: int) -> Cotangents:
        """Return the cotangents of node i, including those from times between it and the next node."""
        sensitivity, costs = self.trajectory.sensitivity, len(self.weights)
        out, p = np.zeros((costs, sensitivity.ny + self.trajectory.n_carry)), np.zeros((costs, sensitivity.k))
        bar_t = np.zeros(costs)
        for m in self._times(i, i + 1):
            bar, by_p, by_t = self._of_time(m)
            out, p, bar_t = out + bar, p + by_p, bar_t + by_t
        return out, p, bar_t

    def of_nodes(self, i: int, j: int) -> tuple[Array, Array]:
        """Return the cotangents of nodes i, ..., j - 1, (j - i, costs, ny + nc), and of the parameters, (costs, k)."""
        sensitivity, costs, times = self.trajectory.sensitivity, len(self.weights), self._times(i, j)
        out, p = np.zeros((j - i, costs, sensitivity.ny + self.trajectory.n_carry)), np.zeros((costs, sensitivity.k))
        if self.signals.is_constant and len(times):  # the same matrix at all nodes
            by_y = self.signals.rows(i, float(self.t[times[0]]), self.points[times[0]])[:, : sensitivity.ny]
            common, times = times[self.at_nodes[times]], times[~self.at_nodes[times]]
            found = np.einsum("cnm,nd->mcd", self.weights[..., common], by_y)
            np.add.at(out[..., : sensitivity.ny], self.nodes[common] - i, found)
        for m in times:
            bar, by_p, _ = self._of_time(m)
            out[self.nodes[m] - i] += bar
            p += by_p
        return out, p

    def _times(self, i: int, j: int) -> Array:
        """Return the indices of the times from node i up to node j, excluding j, on which the costs depend."""
        return np.flatnonzero(self.used[self.bounds[i] : self.bounds[j]]) + self.bounds[i]

    def _of_time(self, m: int) -> Cotangents:
        """Return the cotangents of the node at or before time m."""
        trajectory, i, t = self.trajectory, int(self.nodes[m]), float(self.t[m])
        ny, costs = trajectory.sensitivity.ny, len(self.weights)
        rows = self.weights[:, :, m] @ self.signals.rows(i, t, self.points[m])
        bars = np.hstack([rows[:, :ny], np.zeros((costs, trajectory.n_carry))])
        if self.at_nodes[m]:
            return bars, rows[:, ny:-1], rows[:, -1]
        bars, by_p = trajectory.core.adjoint(trajectory.core.shortened_step(i, t), np.zeros((2, *bars.shape)), bars)
        return bars, rows[:, ny:-1] + by_p, np.zeros(costs)


def adjoint_sweep(
    trajectory: Trajectory, node_cotangents: NodeCotangents, end: EventTimeDerivative | None
) -> tuple[Array, Array]:
    """Return the cotangents of the start y, (costs, ny), and of the parameters, (costs, k).

    Args:
        trajectory: a run.
        node_cotangents: cotangents of the nodes from the costs.
        end: the last step, if the run ended in a terminal event.
    """
    ny, i = trajectory.sensitivity.ny, len(trajectory.ts) - 1
    bars, p, bar_t = node_cotangents.of_node(i)
    if not node_cotangents.used.any():  # the costs do not depend on the motion
        return bars[:, :ny], p
    while i > 0:
        last = end if i + 1 == len(trajectory.ts) else None
        if not last and (j := trajectory.core.segment_start(i)) < i:
            bars, by_p = _reverse_parts(list(trajectory.carry_restart_parts(i)), bars, ny)
            bars, more = _reverse_steps(trajectory, node_cotangents, trajectory.core.nodes(j, i), bars)
            i, p = j, p + by_p + more
            continue
        if last:
            fixed, by_p = last.of_fixed_step(bars[:, :ny].T, bars[:, ny:].T, bar_t)
            bars[:, :ny], p = fixed.T, p + by_p.T
        bars, by_p = _reverse_parts(last.step_parts if last else list(trajectory.step_parts(i - 1)), bars, ny)
        i -= 1
        node_bars, more, _ = node_cotangents.of_node(i)
        bars, p = bars + node_bars, p + by_p + more
    bars, by_p = _reverse_parts(list(trajectory.start_parts()), bars, ny)
    return bars[:, :ny], p + by_p


def _reverse_steps(
    trajectory: Trajectory, node_cotangents: NodeCotangents, nodes: NodeRange, bars: Array
) -> tuple[Array, Array]:
    """Return the cotangents at the start of a range of compiled steps, and of the parameters."""
    node_bars, p = node_cotangents.of_nodes(nodes.steps.start, nodes.steps.stop)
    bars, by_p = trajectory.core.adjoint(nodes, np.concatenate([node_bars, np.zeros_like(bars)[None]]), bars)
    return bars + node_bars[0], p + by_p


def _reverse_parts(parts: list[TrajectoryPart], bars: Array, ny: int) -> tuple[Array, Array]:
    """Return the cotangents of (y, carry) before parts of a run, and of the parameters."""
    p: Array | float = 0.0
    for part in reversed(parts):
        y, carry, by_p = part.reverse(bars[:, :ny].T, bars[:, ny:].T)
        bars, p = np.vstack([y, carry]).T, p + by_p.T
    return bars, np.asarray(p)
