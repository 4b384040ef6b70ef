"""Gradient of a cost of a run by its discrete adjoint, for any number of parameters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...data_types import JsonObject
from ...errors import require
from ...integrate.events.event import Event
from ...integrate.trajectory.trajectory import Trajectory
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from .adjoint import NodeCotangents, adjoint_sweep
from .cost import Cost, Signals, evaluated
from .run_parameters import Model, Names, bind_parameters
from .sensitivity import node_indices, start_columns, start_tangent
from .terminal_event import terminal_event

__all__ = ["gradient"]


@dataclass(frozen=True)
class Gradient(Tabular):
    """A cost of a run and its gradient.

    Attributes:
        value: the cost.
        gradient: derivatives with respect to each parameter, and to (q, v, s) of the start if requested.
    """

    value: float
    gradient: dict[str, float]

    def to_columns(self) -> Columns:
        """Return names and derivatives."""
        return Columns({"parameter": list(self.gradient), "derivative": list(self.gradient.values())})

    def cells(self) -> list[list[str]]:
        """Return names and derivatives."""
        return [["parameter", "derivative"], *([name, f"{x:.6e}"] for name, x in self.gradient.items())]

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {"value": self.value, "gradient": self.gradient}

    def __str__(self) -> str:
        lines = [f"  {name:40s} {x:14.6e}" for name, x in self.gradient.items()]
        return "\n".join([f"cost {self.value:.9g}, derivative with respect to", *lines])


def gradient(
    sol: Solution,
    cost: Cost,
    parameters: Names = (),
    *,
    start: bool = False,
    model: Model = None,
    event: Event | Callable[..., float] | str | None = None,
) -> Gradient:
    """Differentiate a cost of a run by one sweep backward through its steps, for any number of parameters.

    The adjoint of `mbdae.sensitivity`, with the same arguments: <w, J u> = <J^T w, u> to rounding. Besides the run it
    stores the carry of the method at each node, nv + ns + 1 numbers; stages are recomputed.

    Args:
        sol: the run.
        cost: signals -> (value, {signal: derivative (n,)}), with the signals of `mbdae.Solution.signals` by name at the
            times of the run; or `mbdae.Squares`.
        parameters: names, or name = value.
        start: also differentiate with respect to the start.
        model: factory of the mechanism for values of the parameters.
        event: the terminal event in which the run ended, its function or its signal.

    Raises:
        InputError: for a run of another kind, a parameter or a signal without a derivative, a cost that is not finite.
        UnknownNameError: for unknown names.
    """
    require(sol, Solution, "gradient takes a Solution (see mbdae.solve)")
    require(start, bool, "start is True or False")
    trajectory = Trajectory(sol, bind_parameters(sol, parameters, model))
    found = run_cost(trajectory, cost)
    return Gradient(found.value, adjoint_gradients(trajectory, [found], start, event)[0])


class RunCost(NamedTuple):
    """A cost of a run.

    Attributes:
        value: the cost.
        weights: derivatives of the cost with respect to signals by name, (n,) each.
        points: the points at the times of the run, (n, ...).
    """

    value: float
    weights: dict[str, Array]
    points: Array


def run_cost(trajectory: Trajectory, cost: Cost) -> RunCost:
    """Evaluate a cost of a trajectory."""
    sol, nodes = trajectory.sol, node_indices(trajectory.sol)
    between = np.flatnonzero(sol.t != trajectory.ts[nodes])
    points = sol.y.copy() if len(between) else sol.y
    for k in between:
        points[k] = trajectory.point_after(int(nodes[k]), float(sol.t[k]))
    value, weights = evaluated(cost, Signals(replace(sol, y=points)), len(sol.t))
    return RunCost(value, weights, points)


def adjoint_gradients(
    trajectory: Trajectory,
    costs: Sequence[RunCost],
    start: bool = False,
    event: Event | Callable[..., float] | str | None = None,
) -> list[dict[str, float]]:
    """Return derivatives of costs with respect to parameters, and to the start if requested: one sweep backward."""
    k, ny, end = trajectory.sensitivity.k, trajectory.sensitivity.ny, terminal_event(trajectory, event)
    cotangents = NodeCotangents(trajectory, trajectory.sol.t, costs[0].points, [cost.weights for cost in costs])
    bars, p = adjoint_sweep(trajectory, cotangents, end)
    found = bars @ start_tangent(trajectory, np.eye(k, k + (ny - 1) * start), start)
    found[:, :k] += p
    names = [*trajectory.core.varied.values, *(start_columns(trajectory) if start else ())]
    return [dict(zip(names, row, strict=True)) for row in found.tolist()]
