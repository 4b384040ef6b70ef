"""Multiple shooting for periodic motions in local coordinates of the constraint manifold.

Unknowns: the states at k nodes of a period, the period T unless it is fixed, advances sigma along symmetries,

    0 = x(phi_i(y_i)) - x_i+1,   i < k - 1;      0 = x(g(sigma) S P phi_k-1(y_k-1)) - x_0

with coordinates x of states near y_i+1 (`mbdae.mechanism.equations.local_coordinates`): closures are not among the
equations. S subtracts full turns and pitches of ratchets from joints, P exchanges joints. The phases of an autonomous
motion without a section are undetermined: the change of the first node is orthogonal to F = y' and to the directions of
the symmetries. Newton's matrix consists of exact tangents of the computed steps.
Source: Lust, Roose, An adaptive Newton-Picard algorithm (1998); Seydel, Practical bifurcation and stability analysis.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ....errors import InputError
from ....mechanism.equations.local_coordinates import LocalCoordinates
from ....mechanism.equations.symmetry import Symmetry
from ....mechanism.formulations.index2 import Index2System
from ....system import Array
from ....tolerances import AGREEMENT, SOLUTION_ROUNDING
from .exchange import Exchange
from .flow import Flow, FlowTangent, require_same_rows

MAX_REFINEMENTS = 12
HALVED_STEPS = 2**6  # factor of rtol that halves the steps of a method of order 6
MIN_PERIOD_RATIO = 0.5  # smallest ratio of the periods of successive iterations


@dataclass(frozen=True)
class Cycle:
    """Definition of a periodic motion.

    Attributes:
        t: start time.
        segments: number k of shooting segments.
        section: signal and level at which a period ends; None if the phase is free, or fixed by the time.
        period_is_given: whether the period is fixed.
        autonomous: whether the equations do not depend on time.
        symmetries: symmetries along which the motion advances.
        exchange: exchange of joints at the end of a period.
        periods: number of periods of the functions of time in a fixed period that depends on the parameter; 0 if it is
            constant.
    """

    t: float
    segments: int
    section: str | None
    period_is_given: bool
    autonomous: bool
    symmetries: tuple[Symmetry, ...]
    exchange: Exchange
    periods: float = 0.0

    @property
    def unknown_period(self) -> bool:
        """Whether the period is one of Newton's unknowns."""
        return not self.period_is_given and not self.section


@dataclass(frozen=True)
class Guess:
    """Nodes (k, n) of a period, the period, advances (m,), and shifts (nv,) of joints by turns and pitches.

    The modes at the starts of segments, (k,), are known after a run; dT/dp is not 0 if a fixed period depends on the
    parameter.
    """

    nodes: list[Array]
    T: float
    sigma: Array
    shifts: Array
    modes: tuple[tuple[int, ...], ...] = ()
    dT_dp: float = 0.0


class ShootingEquations:
    """The equations of shooting at a guess: residual and tangents.

    Args:
        system: a workspace.
        flow: the runs.
        cycle: definition of the motion.
        guess: the guess.
    """

    def __init__(self, system: Index2System, flow: Flow, cycle: Cycle, guess: Guess) -> None:
        self.system, self.flow, self.cycle, self.guess = system, flow, cycle, guess
        k, self.p = cycle.segments, len(flow.parameters)
        last = guess.T - guess.T * (k - 1) / k
        self.durations = [guess.T / k] * (k - 1) + [last]
        self.times = [cycle.t + sum(self.durations[:i]) for i in range(k)]
        self.runs = list(map(flow.run, self.times, guess.nodes, self.durations, self._sections))
        for run, following in zip(self.runs, [*self.runs[1:], self.runs[0]], strict=True):
            require_same_rows(run, following)
        self.modes = tuple(run.mode(0) for run in self.runs)
        points = zip(self._workspaces(), self.times, guess.nodes, strict=True)
        self.charts = [LocalCoordinates(*point) for point in points]
        self.n = self.charts[0].n
        if any(chart.n != self.n for chart in self.charts):
            raise InputError("degrees of freedom differ between the segments of the period: give segments=1")

    @property
    def _sections(self) -> list[str | None]:
        return [*[None] * (self.cycle.segments - 1), self.cycle.section]

    @cached_property
    def lifts(self) -> list[Array]:
        """Maps from variations of the local coordinates of each node to variations of its state, (ny, n) each."""
        out = []
        for chart, t in zip(self.charts, self.times, strict=True):
            found = chart.partials(t, chart.x0)
            out.append(np.vstack([found.dq, found.dv, found.ds, np.zeros((1, self.n + 1))])[:, : self.n])
        return out

    @cached_property
    def tangents(self) -> list[FlowTangent]:
        """Tangents of the segments, computed on demand.

        Raises:
            InputError: for runs without derivatives.
        """
        varied = [np.hstack([lift, np.zeros((len(lift), self.p))]) for lift in self.lifts]
        return list(map(self.flow.tangent, self.runs, varied, self._sections))

    def _workspaces(self) -> list[Index2System]:
        """Return a workspace for each segment in the mode in which it begins."""
        out = [self.system, *(self.system.new_workspace() for _ in self.modes[1:])]
        for workspace, mode in zip(out, self.modes, strict=True):
            workspace.enter(mode)
        return out

    @cached_property
    def return_map(self) -> tuple[Array, Array, Array]:
        """The end of the period after P, S and g(sigma), y (n,), the tangent map (ny, ny), and directions w (ny, m)."""
        s, y = self.system, self.runs[-1].y[-1].copy()
        q, nq, nv = self.cycle.exchange.apply(s.split(y)[0]), s.nq, s.nv
        q = s.manifold.integrate(q, -self.guess.shifts) if self.guess.shifts.any() else q
        D = self.cycle.exchange.of_v
        v = D @ y[nq : nq + nv]
        directions: list[Array] = []
        for symmetry, sigma in zip(self.cycle.symmetries, self.guess.sigma.tolist(), strict=True):
            moved = symmetry.moved(q, sigma)
            differential = symmetry.tangent(q, moved, sigma)
            directions = [differential @ w for w in directions]
            D, v, q = differential @ D, differential @ v, moved
            directions.append(symmetry.direction(q))
        y[:nq], y[nq : nq + nv] = q, v
        tangent_map = np.eye(s.ny)
        tangent_map[:nv, :nv] = tangent_map[nv : 2 * nv, nv : 2 * nv] = D
        w = np.zeros((s.ny, len(directions)))
        for k, symmetry in enumerate(self.cycle.symmetries):
            w[:nv, k], w[nv : 2 * nv, k] = directions[k], symmetry.velocity_change(q, v)
        return y, tangent_map, w

    @cached_property
    def residual(self) -> Array:
        """Distance of the end of each segment from the next node, in local coordinates of that node, (k n,)."""
        charts = [*self.charts[1:], self.charts[0]]
        ends = [*(run.y[-1] for run in self.runs[:-1]), self.return_map[0]]
        return np.concatenate([chart.coordinates_of(y) - chart.x0 for chart, y in zip(charts, ends, strict=True)])

    def _at_next_node(self, i: int, dy: Array) -> Array:
        """Return tangents at the end of segment i in coordinates of the next node, (n, m)."""
        k = self.cycle.segments
        if i < k - 1:
            return self.charts[i + 1].coordinate_tangents(self.runs[i].y[-1], dy)
        y, tangent_map, _ = self.return_map
        return self.charts[0].coordinate_tangents(y, tangent_map @ dy)

    @cached_property
    def factors(self) -> list[Array]:
        """Tangents over each segment at fixed times, (n, n): their product is the monodromy matrix."""
        return [self._at_next_node(i, end.fixed[:, : self.n]) for i, end in enumerate(self.tangents)]

    def flow_direction(self, i: int) -> Array:
        """Return y' at node i in its coordinates, (n,)."""
        return self.charts[i].coordinate_tangents(self.guess.nodes[i], self.tangents[i].first_rate[:, None])[:, 0]

    def symmetry_directions(self, i: int) -> Array:
        """Return the directions of the symmetries at node i in its coordinates, (n, m)."""
        s, y = self.system, self.guess.nodes[i]
        q, v = s.split(y)
        out = np.zeros((s.ny, len(self.cycle.symmetries)))
        for j, symmetry in enumerate(self.cycle.symmetries):
            out[: s.nv, j] = symmetry.direction(q)
            out[s.nv : 2 * s.nv, j] = symmetry.velocity_change(q, v)
        return self.charts[i].coordinate_tangents(y, out)

    def energy_gradient(self, i: int) -> Array:
        """Return the gradient of the energy at node i in its local coordinates, (n,)."""
        return self.tangents[i].energy @ self.lifts[i]

    @cached_property
    def matrix(self) -> Array:
        """Newton's matrix: partials of residual and phases with respect to (x_0, ..., x_k-1, T, sigma, p)."""
        n, k, m = self.n, self.cycle.segments, len(self.cycle.symmetries)
        period = int(self.cycle.unknown_period)
        A = np.zeros((n * k, n * k + period + m + self.p))
        for i, end in enumerate(self.tangents):
            rows, following = slice(i * n, (i + 1) * n), (i + 1) % k
            transition = self._at_next_node(i, end.on_section)
            A[rows, i * n : (i + 1) * n] += transition[:, :n]
            A[rows, following * n : (following + 1) * n] -= np.eye(n)
            if period:
                A[rows, n * k] = self._at_next_node(i, end.rate[:, None])[:, 0] / k
            if self.p:
                nodes = self.charts[following].coordinate_tangents(
                    self.guess.nodes[following], self.tangents[following].start[:, n:]
                )
                A[rows, n * k + period + m :] = transition[:, n:] - nodes
                if self.guess.dT_dp:
                    A[rows, n * k + period + m :] += self.guess.dT_dp * self._period_derivative(i, transition[:, :n])
        y, _, w = self.return_map
        A[n * (k - 1) :, n * k + period : n * k + period + m] = self.charts[0].coordinate_tangents(y, w)
        phases = np.zeros((period + m, A.shape[1]))
        if period:
            phases[0, :n] = _unit(self.flow_direction(0))
        phases[period:, :n] = _unit(self.symmetry_directions(0)).T
        return np.vstack([A, phases])

    def _period_derivative(self, i: int, transition: Array) -> Array:
        """Return the derivative of residual i with respect to a fixed period, (n, 1).

        The segment is longer, and begins later.
        """
        rate = self._at_next_node(i, self.tangents[i].rate[:, None])
        later = rate - transition @ self.flow_direction(i)[:, None]
        return np.asarray((rate + i * later) / self.cycle.segments)

    def guess_after(self, step: Array) -> Guess:
        """Return the guess after a step of (x_0, ..., x_k-1, T, sigma)."""
        n, k, guess = self.n, self.cycle.segments, self.guess
        nodes = []
        for i, chart in enumerate(self.charts):
            q, v, s = chart.state(self.times[i], chart.x0 + step[i * n : (i + 1) * n])
            nodes.append(np.concatenate([q, v, s, [0.0]]))
        period = int(self.cycle.unknown_period)
        T = guess.T + (step[n * k] if period else 0.0)
        if not MIN_PERIOD_RATIO * sum(self.durations) < T:
            raise InputError(f"the period shrank to {T:.3g} s: give a better guess of the motion or of T")
        advance = step[n * k + period : n * k + period + len(guess.sigma)]
        return replace(guess, nodes=nodes, T=float(T), sigma=guess.sigma + advance, modes=self.modes)

    @property
    def size(self) -> float:
        """Largest residual relative to the magnitudes of states."""
        scale = 1 + np.abs(np.concatenate([c.x0 for c in [*self.charts[1:], self.charts[0]]]))
        return float(np.abs(self.residual / scale).max(initial=0.0))

    @cached_property
    def longest_step(self) -> float:
        """Longest step of the runs in s."""
        return max(float(np.diff(run.nodes[0]).max()) for run in self.runs)

    def refine_steps(self) -> "ShootingEquations":
        """Return the equations with steps that resolve the tangents of the motion, not only the motion.

        Step-size control ignores tangents: steps of a steady motion are long, even if perturbations change fast. So the
        longest step is halved until the monodromy matrix no longer changes; rtol reduces the remaining steps as well.
        """
        current, h, rtol = self, self.longest_step, float(self.flow.options["rtol"])
        for _ in range(MAX_REFINEMENTS):
            h, rtol = h / 2, max(rtol / HALVED_STEPS, min(rtol, SOLUTION_ROUNDING))
            options = {**self.flow.options, "max_step": h, "rtol": rtol}
            finer = ShootingEquations(self.system, replace(self.flow, options=options), self.cycle, self.guess)
            change = max(np.abs(a - b).max(initial=0.0) for a, b in zip(current.factors, finer.factors, strict=True))
            size = max(np.abs(a).max(initial=1.0) for a in finer.factors)
            current = finer
            if change <= AGREEMENT * size:
                return current
        raise InputError(f"tangents of the motion do not converge with steps down to {h:.3g} s: give a smaller rtol")


def _unit(x: Array) -> Array:
    size = np.linalg.norm(x, axis=0)
    return x / np.where(size > 0, size, 1.0)
