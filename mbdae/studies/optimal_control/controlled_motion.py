"""A motion with given inputs, and the derivatives of its signals with respect to them from one forward sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...errors import StepError
from ...integrate.simulator.simulator import Simulator
from ...integrate.trajectory.signal_jacobian import SignalJacobian, differentiable
from ...mechanism.time_functions.input_functions import InputSetting
from ...solution.signal_value import SignalValue, find_point_signal, value
from ...solution.solution import Solution
from ...system import Array
from ..optimize.objective import CostEvaluation

SIMPSON = (4.0, 2.0)  # weights of odd and even inner points, over h/3; those of both ends are 1


class Grid(NamedTuple):
    """The unknowns z: values of each input at points in time, or on the intervals between them, and the duration.

    Attributes:
        names: names of the inputs.
        linear: names of the inputs that are linear between points; the remaining ones are piecewise constant.
        points: number of points.
        steps: number of steps in each interval; even.
        duration: duration in s; None if it is the last unknown.
    """

    names: tuple[str, ...]
    linear: tuple[str, ...]
    points: int
    steps: int
    duration: float | None

    def value_counts(self) -> dict[str, int]:
        """Return the number of values of each input."""
        return {name: self.points - (name not in self.linear) for name in self.names}

    def unknowns(self) -> list[str]:
        """Return the names of z."""
        inputs = [f"{name}.{k}" for name, n in self.value_counts().items() for k in range(n)]
        return [*inputs, *(["duration"] if self.duration is None else [])]

    def columns(self, name: str) -> range:
        """Return the indices of the values of an input in z."""
        first = sum(n for other, n in list(self.value_counts().items())[: self.names.index(name)])
        return range(first, first + self.value_counts()[name])

    def weights(self) -> Array:
        """Return the weights of the integral over an interval of length 1 by Simpson's rule, (steps + 1,)."""
        inner = [SIMPSON[i % 2] for i in range(self.steps - 1)]
        return np.array([1.0, *inner, 1.0]) / (3 * self.steps)


@dataclass(frozen=True)
class ControlledMotion:
    """A motion, with signals at the nodes and their derivatives with respect to the unknowns.

    Attributes:
        shooting: the shooting problem.
        z: the unknowns, (k,).
        t: times of the nodes, (points - 1, steps + 1): points between two intervals are in both.
        values: values of signals and inputs, (points - 1, steps + 1) each.
        partials: derivatives of the values with respect to z, (points - 1, steps + 1, k) each.
    """

    shooting: "Shooting"
    z: Array
    t: Array
    values: dict[str, Array]
    partials: dict[str, Array]
    bound = 0  # the unknowns are inputs, not parameters

    @property
    def duration(self) -> float:
        """Duration in s."""
        return float(self.t[-1, -1] - self.t[0, 0])

    @cached_property
    def result(self) -> Solution:
        """The run, which is recomputed."""
        return self.shooting.run(self.z)

    def at_points(self, name: str) -> Array:
        """Return a signal at the points, (points,)."""
        return np.append(self.values[name][:, 0], self.values[name][-1, -1])

    def evaluate(self, function: Any, label: str = "") -> CostEvaluation:
        """Evaluate a cost or a constraint: function(motion) -> (value, derivatives (k,))."""
        found, derivatives = function(self)
        return CostEvaluation(found, lambda: derivatives)


class Shooting:
    """Motions as functions of the unknowns, from one start.

    Args:
        simulator: simulator in its start state.
        grid: the unknowns.
        signals: names of the signals that costs and constraints need.

    Raises:
        UnknownNameError: for an unknown signal.
        InputError: for a signal without a derivative.
    """

    def __init__(self, simulator: Simulator, grid: Grid, signals: Sequence[str]) -> None:
        self.simulator, self.grid, self.start = simulator, grid, simulator.save()
        self.names = [name for name in dict.fromkeys(signals) if name not in grid.names]
        self.known: dict[str, SignalValue] = {}
        for name in self.names:
            self.known[name] = find_point_signal(simulator.mechanism, name)
            differentiable(simulator.mechanism, name)

    def _begin(self, z: Array) -> float:
        """Restore the start with its inputs, and return the length of an interval."""
        grid, simulator = self.grid, self.simulator
        dt = float(grid.duration if grid.duration is not None else z[-1]) / (grid.points - 1)
        step = dt / grid.steps
        simulator.options = simulator.options._replace(step=step)
        first = {name: InputSetting(self.start.start, float(z[grid.columns(name)[0]])) for name in grid.names}
        origin = self.start.origin._replace(step=step)
        simulator.restore(replace(self.start, inputs={**self.start.inputs, **first}, origin=origin))
        return dt

    def _advance(self, z: Array, k: int, dt: float) -> None:
        """Advance over interval k.

        Raises:
            StepError: if a step fails, or steps are not equal.
        """
        for name in self.grid.names:
            self.simulator[name] = float(z[self.grid.columns(name)[k + (name in self.grid.linear)]])
        before = len(self.simulator._run.ts)
        self.simulator.advance(dt)
        if len(self.simulator._run.ts) - before not in (self.grid.steps, self.grid.steps + 1):
            raise StepError("step_size", f"events or jumps divide the steps before t = {self.simulator.t:.6g} s")

    def run(self, z: Array) -> Solution:
        """Return the motion as a solution.

        Raises:
            StepError: if a step fails.
        """
        dt = self._begin(z)
        for k in range(self.grid.points - 1):
            self._advance(z, k, dt)
        return self.simulator.solution()

    def __call__(self, values: Mapping[str, float]) -> ControlledMotion:
        """Return the motion of given unknowns, with derivatives.

        Raises:
            StepError: if a step fails.
            InputError: if the motion has no derivatives.
        """
        z, grid = np.array(list(values.values())), self.grid
        dt, n, m = self._begin(z), grid.points - 1, grid.steps + 1
        t, dy = np.empty((n, m)), np.zeros((self.simulator._run.system.ny, len(z)))
        found = {name: np.empty((n, m)) for name in (*grid.names, *self.names)}
        partials = {name: np.zeros((n, m, len(z))) for name in found}
        fraction = np.linspace(0.0, 1.0, m)
        for k in range(n):
            self._advance(z, k, dt)
            for name in grid.names:
                columns, last = grid.columns(name), k + (name in grid.linear)
                found[name][k] = (1 - fraction) * z[columns[k]] + fraction * z[columns[last]]
                partials[name][k, :, columns[k]] += 1 - fraction
                partials[name][k, :, columns[last]] += fraction
            t[k], dy = self._differentiate(k, dy, found, partials)
        for name, signal in self.known.items():
            if signal.kind == "angle":
                found[name] = np.unwrap(found[name].ravel()).reshape(n, m)
        return ControlledMotion(self, z, t, found, partials)

    def _differentiate(
        self, k: int, dy: Array, found: dict[str, Array], partials: dict[str, Array]
    ) -> tuple[Array, Array]:
        """Store signals on interval k and their derivatives; return times of nodes, and derivatives of y at the end."""
        grid, span = self.grid, self.simulator.differentiated()
        p, trajectory, width = span.parameters, span.trajectory, dy.shape[1]
        dp, dt = np.zeros((len(p.columns), width)), np.zeros(width)
        for name in grid.names:
            columns = grid.columns(name)
            dp[p.column("input", name), columns[k + (name in grid.linear)]] = 1.0
            if name in grid.linear:
                dp[p.column("input of first order", name), columns[k]] = 1.0
        if grid.duration is None:
            dt[-1] = 1.0 / (grid.points - 1)
        tangents, first = span.tangents(dy, dp, dt), len(trajectory.ts) - grid.steps - 1
        rows = SignalJacobian(trajectory, self.names) if self.names else None
        for j in range(grid.steps + 1):
            i, time = first + j, float(trajectory.ts[first + j])
            dt_node = dt * (k + j / grid.steps)  # derivative of the node's time
            dp_node = dp + span.fixed_inputs(dt_node)
            if rows:
                trajectory.enter_node(i)
            for name in self.names:
                found[name][k, j] = value(trajectory.system, self.known[name], time, trajectory.ys[i])
            if rows:
                by_z = rows.rows(i, time, trajectory.ys[i]) @ np.vstack([tangents[i], dp_node, dt_node])
                for name, row in zip(self.names, by_z, strict=True):
                    partials[name][k, j] = row
        return trajectory.ts[first:], tangents[-1]
