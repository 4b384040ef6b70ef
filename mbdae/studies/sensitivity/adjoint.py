"""Back along a run: the cotangents of its nodes, of what arrives there from the signals of a cost."""

from collections.abc import Mapping

import numpy as np

from ...integrate.native_trajectory import NodeRange
from ...integrate.trajectory import Trajectory, TrajectoryPart
from ...system import Array
from .signal_jacobian import SignalJacobian
from .terminal_event import EventTimeDerivative

Cotangents = tuple[Array, Array, float]  # of y and what is carried, (ny + nc,), of the parameters, (k,), and of time


class NodeCotangents:
    """Cotangents of the nodes of a run that a cost causes.

    Args:
        trace: the run.
        t: its times, (n,).
        points: there, (n, ...).
        weights: derivatives of the cost with respect to signals by name, (n,) each.
    """

    def __init__(self, trace: Trajectory, t: Array, points: Array, weights: Mapping[str, Array]) -> None:
        self.trace, self.t, self.points = trace, t, points
        self.signals = SignalJacobian(trace, list(weights))
        self.weights = np.array(list(weights.values())).reshape(len(weights), len(t))
        places = trace.sol.before(t) if trace.sol.steps else np.arange(len(t))
        self.fixed: Array | None = None  # rows of signals that are the same everywhere, times the weights
        if weights and len(t) and self.signals.fixed:
            self.fixed = self.weights.T @ self.signals.rows(0, float(t[0]), points[0])
        self.bounds = np.searchsorted(places, np.arange(len(trace.ts) + 1))

    def at(self, i: int) -> Cotangents:
        """Return the cotangents of node i, from the times between it and the next one, too."""
        trace, ny = self.trace, self.trace.sensitivity.ny
        out, p, late = np.zeros(ny + trace.n_carry), np.zeros(trace.sensitivity.k), 0.0
        for m in range(self.bounds[i], self.bounds[i + 1]):
            w, t = self.weights[:, m], float(self.t[m])
            if not w.any():
                continue
            row = w @ self.signals.rows(i, t, self.points[m]) if self.fixed is None else self.fixed[m]
            p += row[ny:-1]
            if t == trace.ts[i]:
                out[:ny] += row[:ny]
                late += float(row[-1])
            else:
                bar, by_p = self._back(i, t, np.concatenate([row[:ny], np.zeros(trace.n_carry)]))
                out, p = out + bar, p + by_p
        return out, p, late

    def _back(self, i: int, t: float, bar: Array) -> tuple[Array, Array]:
        """From a time behind node i, where a shorter step ends."""
        core = self.trace.core
        return core.adjoint(core.shortened_step(i, t), np.zeros((2, len(bar))), bar)


def adjoint_sweep(
    trace: Trajectory, arriving: NodeCotangents, end: EventTimeDerivative | None, k: int
) -> tuple[Array, Array]:
    """Return the cotangents of the given start y, (ny,), and of the parameters, (k,).

    Args:
        trace: a run.
        arriving: cotangents of its nodes by the cost.
        end: the last step, where it ended in a terminal event.
        k: number of parameters.
    """
    ny, i = trace.sensitivity.ny, len(trace.ts) - 1
    bar, p, late = arriving.at(i)
    while i > 0:
        last = end if i + 1 == len(trace.ts) else None
        if not last and (j := trace.core.segment_start(i)) < i:
            at_i, by_p = _all_reversed(list(trace.carry_restart_parts(i)), bar, ny, k)
            bar, more = _at_once(trace, arriving, trace.core.nodes(j, i), at_i)
            i, p = j, p + by_p + more
            continue
        if last:
            held, by_p = last.of_fixed_step(bar[:ny, None], bar[ny:, None], late)
            bar[:ny], p = held[:, 0], p + by_p
        bar, by_p = _all_reversed(last.parts if last else list(trace.step_parts(i - 1)), bar, ny, k)
        i -= 1
        own, more, _ = arriving.at(i)
        bar, p = bar + own, p + by_p + more
    bar, by_p = _all_reversed(list(trace.start_parts()), bar, ny, k)
    return bar[:ny], p + by_p


def _at_once(trace: Trajectory, arriving: NodeCotangents, nodes: NodeRange, bar: Array) -> tuple[Array, Array]:
    """The same along some steps at once."""
    own = [arriving.at(i) for i in nodes.steps]
    extra = np.array([*(x[0] for x in own), np.zeros_like(bar)])
    at, by_p = trace.core.adjoint(nodes, extra, bar)
    return at + own[0][0], by_p + sum(x[1] for x in own)


def _all_reversed(parts: list[TrajectoryPart], bar: Array, ny: int, k: int) -> tuple[Array, Array]:
    """Back through parts of a run: cotangents of y and what is carried, and of the parameters."""
    p = np.zeros(k)
    for part in reversed(parts):
        y, carry, by_p = part.reverse(bar[:ny, None], bar[ny:, None])
        bar, p = np.concatenate([y[:, 0], carry[:, 0]]), p + by_p[:, 0]
    return bar, p
