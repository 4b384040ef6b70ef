"""Adjoint sweep along a run: cotangents of its nodes from a cost of signals."""

from collections.abc import Mapping

import numpy as np

from ...integrate.trajectory.native_trajectory import NodeRange
from ...integrate.trajectory.trajectory import Trajectory, TrajectoryPart
from ...system import Array
from .signal_jacobian import SignalJacobian
from .terminal_event import EventTimeDerivative

Cotangents = tuple[Array, Array, float]  # of (y, carry), (ny + nc,), of the parameters, (k,), and of time


class NodeCotangents:
    """Cotangents of the nodes of a run from a cost of signals.

    Args:
        trace: the run.
        t: its times, (n,).
        points: the points at these times, (n, ...).
        weights: derivatives of the cost with respect to signals by name, (n,) each.
    """

    def __init__(self, trace: Trajectory, t: Array, points: Array, weights: Mapping[str, Array]) -> None:
        self.trace, self.t, self.points = trace, t, points
        self.signals = SignalJacobian(trace, list(weights))
        self.weights = np.array(list(weights.values())).reshape(len(weights), len(t))
        nodes = trace.sol.before(t) if trace.sol.steps else np.arange(len(t))
        self.fixed: Array | None = None  # weighted rows of signals with constant derivatives
        if weights and len(t) and self.signals.fixed:
            self.fixed = self.weights.T @ self.signals.rows(0, float(t[0]), points[0])
        self.bounds = np.searchsorted(nodes, np.arange(len(trace.ts) + 1))

    def at(self, i: int) -> Cotangents:
        """Return the cotangents of node i, including those from times between it and the next node."""
        trace, ny = self.trace, self.trace.sensitivity.ny
        out, p, bar_t = np.zeros(ny + trace.n_carry), np.zeros(trace.sensitivity.k), 0.0
        for m in range(self.bounds[i], self.bounds[i + 1]):
            w, t = self.weights[:, m], float(self.t[m])
            if not w.any():
                continue
            row = w @ self.signals.rows(i, t, self.points[m]) if self.fixed is None else self.fixed[m]
            p += row[ny:-1]
            if t == trace.ts[i]:
                out[:ny] += row[:ny]
                bar_t += float(row[-1])
            else:
                bar, by_p = self._from_short_step(i, t, np.concatenate([row[:ny], np.zeros(trace.n_carry)]))
                out, p = out + bar, p + by_p
        return out, p, bar_t

    def _from_short_step(self, i: int, t: float, bar: Array) -> tuple[Array, Array]:
        """Return cotangents of node i and of the parameters from those at time t, by a shortened step."""
        core = self.trace.core
        return core.adjoint(core.shortened_step(i, t), np.zeros((2, len(bar))), bar)


def adjoint_sweep(
    trace: Trajectory, node_cotangents: NodeCotangents, end: EventTimeDerivative | None, k: int
) -> tuple[Array, Array]:
    """Return the cotangents of the start y, (ny,), and of the parameters, (k,).

    Args:
        trace: a run.
        node_cotangents: of its nodes from the cost.
        end: the last step, if the run ended in a terminal event.
        k: number of parameters.
    """
    ny, i = trace.sensitivity.ny, len(trace.ts) - 1
    if not node_cotangents.weights.any():  # of a cost that does not depend on the motion
        return np.zeros(ny), np.zeros(k)
    bar, p, bar_t = node_cotangents.at(i)
    while i > 0:
        last = end if i + 1 == len(trace.ts) else None
        if not last and (j := trace.core.segment_start(i)) < i:
            at_i, by_p = _reverse_parts(list(trace.carry_restart_parts(i)), bar, ny, k)
            bar, more = _reverse_steps(trace, node_cotangents, trace.core.nodes(j, i), at_i)
            i, p = j, p + by_p + more
            continue
        if last:
            fixed, by_p = last.of_fixed_step(bar[:ny, None], bar[ny:, None], bar_t)
            bar[:ny], p = fixed[:, 0], p + by_p
        bar, by_p = _reverse_parts(last.parts if last else list(trace.step_parts(i - 1)), bar, ny, k)
        i -= 1
        bar_i, more, _ = node_cotangents.at(i)
        bar, p = bar + bar_i, p + by_p + more
    bar, by_p = _reverse_parts(list(trace.start_parts()), bar, ny, k)
    return bar[:ny], p + by_p


def _reverse_steps(
    trace: Trajectory, node_cotangents: NodeCotangents, nodes: NodeRange, bar: Array
) -> tuple[Array, Array]:
    """Return the cotangents after a range of compiled steps."""
    cotangents = [node_cotangents.at(i) for i in nodes.steps]
    extra = np.array([*(x[0] for x in cotangents), np.zeros_like(bar)])
    at, by_p = trace.core.adjoint(nodes, extra, bar)
    return at + cotangents[0][0], by_p + sum(x[1] for x in cotangents)


def _reverse_parts(parts: list[TrajectoryPart], bar: Array, ny: int, k: int) -> tuple[Array, Array]:
    """Return the cotangents of (y, carry) before parts of a run, and of the parameters."""
    p = np.zeros(k)
    for part in reversed(parts):
        y, carry, by_p = part.reverse(bar[:ny, None], bar[ny:, None])
        bar, p = np.concatenate([y[:, 0], carry[:, 0]]), p + by_p[:, 0]
    return bar, p
