"""Discrete tangent of a run: derivatives of the computed steps with respect to parameters and the start."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, MbdaeError, require
from ...integrate.events.event import Event
from ...integrate.trajectory.signal_jacobian import SignalJacobian, SignalPoint
from ...integrate.trajectory.trajectory import Trajectory
from ...mechanism.tree.coordinate_units import coordinate_units
from ...mechanism.tree.frames import find_joint
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from ...tolerances import COINCIDENT
from .run_parameters import Model, Names, bind_parameters
from .terminal_event import terminal_event

__all__ = ["sensitivity"]


@dataclass(frozen=True)
class Sensitivity(Tabular):
    """Derivatives of a run with respect to k columns: parameters, then (q, v, s) of the start if requested.

    Attributes:
        parameters: names and values.
        columns: names of the k columns.
        t: times, (n,); the time of a jump occurs twice.
        y: points, (n, ...): those of the run at nodes, and those of shortened steps of the method between nodes.
        dy: derivatives of the points, (n, 2 nv + ns + 1, k), those of q in the tangent.
        dt: derivatives of the times, (n, k): nonzero for the time of a terminal event.
    """

    parameters: dict[str, float]
    columns: tuple[str, ...]
    t: Array
    y: Array
    dy: Array
    dt: Array
    trajectory: Trajectory = field(repr=False)
    nodes: Array = field(repr=False)

    @property
    def q(self) -> Array:
        """Derivatives of q in the tangent, (n, nv, k), in rad or m per unit of the parameter."""
        return self.dy[:, : self.trajectory.system.nv]

    @property
    def v(self) -> Array:
        """Derivatives of v, (n, nv, k)."""
        return self.dy[:, self.trajectory.system.nv : 2 * self.trajectory.system.nv]

    @property
    def s(self) -> Array:
        """Derivatives of the states of actuators and controllers, (n, ns, k)."""
        return self.dy[:, 2 * self.trajectory.system.nv : -1]

    @property
    def work(self) -> Array:
        """Derivatives of the work of non-conservative forces and drivers, (n, k)."""
        return self.dy[:, -1]

    @property
    def lam(self) -> Array:
        """Derivatives of the multipliers of all rows, (n, ng, k), from the hidden constraint."""
        return np.array([point.rates.multipliers for point in self._points])

    @cached_property
    def _points(self) -> list[SignalPoint]:
        """The run at each time, with the derivatives with respect to the columns."""
        points = zip(self.nodes.tolist(), self.t.tolist(), self.y, self.dy, self.dt, strict=True)
        return [SignalPoint(self.trajectory, i, t, y, (dy, self.dp, dt)) for i, t, y, dy, dt in points]

    @property
    def dp(self) -> Array:
        """Derivatives of the parameters, (k_p, k): identity and zeros."""
        return np.eye(len(self.parameters), len(self.columns))

    def signal(self, name: str) -> Array:
        """Return derivatives of a signal of `mbdae.Solution.signals`, (n, k).

        Raises:
            UnknownNameError: for a signal that does not exist.
            InputError: for a signal without a derivative.
        """
        require(name, str, "a signal is given by its name")
        jacobian = SignalJacobian(self.trajectory, [name])
        return np.array([jacobian.directional_derivatives(point)[0] for point in self._points])

    def to_columns(self) -> Columns:
        """Return derivatives of q in the tangent and of v over time, ``d(q.crank)/d(force.spring.stiffness)``."""
        names = [n[2:] for n in coordinate_units(self.trajectory.system.mechanism) if n.startswith("v.")]
        columns: dict[str, Array] = {"t": self.t}
        for letter, x in (("q", self.q), ("v", self.v)):
            pairs = [(i, k) for i in range(len(names)) for k in range(len(self.columns))]
            columns |= {f"d({letter}.{names[i]})/d({self.columns[k]})": x[:, i, k] for i, k in pairs}
        return Columns(columns, {"t": "s"}, "t")

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "parameters": self.parameters,
            "columns": list(self.columns),
            "t": self.t.tolist(),
            "q": self.q.tolist(),
            "v": self.v.tolist(),
        }

    def __str__(self) -> str:
        size = {name: float(np.abs(self.dy[-1, :-1, i]).max()) for i, name in enumerate(self.columns)}
        lines = [f"  {name:40s} {x:12.4e}" for name, x in size.items()]
        return "\n".join([f"largest derivative of (q, v, s) at t = {self.t[-1]:g} s", *lines])


def sensitivity(
    sol: Solution,
    parameters: Names = (),
    *,
    start: bool = False,
    model: Model = None,
    event: Event | Callable[..., float] | str | None = None,
) -> Sensitivity:
    """Differentiate a run by half-explicit methods or Radau IIA with respect to parameters and its start.

    Step sizes and independent rows are frozen: the derivative is that of the computed steps, exact to rounding
    (mbdae/native/sensitivity). If the run began at the mechanism's start, this depends on the parameters through the
    assembly; a given start is constant. Sampling instants and times of jumps are constant.

    Args:
        sol: the run. At times of ``t_eval`` between its nodes, derivatives are those of shortened steps of the method.
        parameters: dotted names, as in sweeps (``force.spring.stiffness``, ``joint.crank.mass``, ``start.v.crank``), or
            name = value for models without known values. At the limit of a parameter's range (a damping of 0) the
            derivative is one-sided, with a warning.
        start: also differentiate with respect to (q, v, s) at the start, q in its tangent, without constraints.
        model: factory of the mechanism for values of the parameters, see `mbdae.sweep`: a file or a function; by
            default the source of the mechanism.
        event: the terminal event in which the run ended, its function or its signal, whose time is differentiated, too.

    Raises:
        InputError: for a run of another kind, or a parameter without a derivative; without the compiled core.
        UnknownNameError: for an unknown name.
    """
    require(sol, Solution, "sensitivity takes a Solution (see mbdae.solve)")
    require(start, bool, "start is True or False")
    bound = bind_parameters(sol, parameters, model)
    if not bound.values and not start:
        raise InputError("a sensitivity takes parameters, a list of dotted names, or start=True")
    return trajectory_sensitivity(Trajectory(sol, bound), start, event)


def trajectory_sensitivity(
    trajectory: Trajectory, start: bool = False, event: Event | Callable[..., float] | str | None = None
) -> Sensitivity:
    """Differentiate a trajectory with bound parameters, see `sensitivity`."""
    values = trajectory.core.varied.values
    columns = (*values, *(start_columns(trajectory) if start else ()))
    dp = np.eye(len(values), len(columns))
    return run_tangents(trajectory, columns, start_tangent(trajectory, dp, start), dp, event)


def run_tangents(
    trajectory: Trajectory,
    columns: tuple[str, ...],
    dy: Array,
    dp: Array,
    event: Event | Callable[..., float] | str | None = None,
) -> Sensitivity:
    """Return the tangents of a run for variations dy (ny, m) of its start and dp (k, m) of the parameters.

    Args:
        trajectory: the run.
        columns: names of the m variations.
        dy: variations of the start.
        dp: variations of the parameters.
        event: the terminal event in which the run ended.
    """
    sol, values, end = trajectory.sol, trajectory.core.varied.values, terminal_event(trajectory, event)
    carry = np.zeros((trajectory.n_carry, len(columns)))
    dy, carry = _apply(trajectory.start_parts(), dy, carry, dp)
    out, i, ny = _Tangents(sol, trajectory, dp), 0, len(dy)
    while i + 1 < len(trajectory.ts):
        j = trajectory.core.segment_end(i, end is not None)
        if j > i:
            found = trajectory.core.tangent(trajectory.core.nodes(i, j), np.concatenate([dy, carry]).T, dp.T)
            out.at_nodes(i, found)
            i, dy, carry = i + len(found) - 1, found[-1, :, :ny].T, found[-1, :, ny:].T
            dy, carry = _apply(trajectory.carry_restart_parts(i), dy, carry, dp)
            continue
        out.at_node(i, dy, carry)
        if end and i + 2 == len(trajectory.ts):
            dh = end.time_derivative(dy, carry, dp)
            out.dt[sol.t == trajectory.ts[-1]] = dh
            dy, carry = end.forward(dy, carry, dp, dh)
        else:
            dy, carry = _apply(trajectory.step_parts(i), dy, carry, dp)
        i += 1
    out.at_node(i, dy, carry)
    return Sensitivity(values, columns, np.asarray(sol.t), out.y, out.dy, out.dt, trajectory, out.nodes)


class _Tangents:
    """Points y (n, ...), derivatives dy (n, ny, k) and dt (n, k) at the times of a run, filled in node by node."""

    def __init__(self, sol: Solution, trajectory: Trajectory, dp: Array) -> None:
        n, k = len(sol.t), dp.shape[1]
        self.t, self.trajectory, self.dp = sol.t, trajectory, dp
        self.nodes = node_indices(sol)
        self.bounds = np.searchsorted(self.nodes, np.arange(len(trajectory.ts) + 1))
        self.y, self.dy, self.dt = sol.y.copy(), np.zeros((n, trajectory.sensitivity.ny, k)), np.zeros((n, k))

    def at_node(self, i: int, dy: Array, carry: Array) -> None:
        """Fill in the times from node i up to the next node."""
        for k in range(self.bounds[i], self.bounds[i + 1]):
            self.y[k], self.dy[k] = _at_time(self.trajectory, i, float(self.t[k]), dy, carry, self.dp)

    def at_nodes(self, i: int, found: Array) -> None:
        """Fill in the times from node i up to the last of the m nodes of ``found`` (m, k, ny + ...), excluding it."""
        trajectory, ny = self.trajectory, self.dy.shape[1]
        times = slice(self.bounds[i], self.bounds[i + len(found) - 1])
        nodes = self.nodes[times]
        self.y[times], self.dy[times] = trajectory.ys[nodes], found[nodes - i, :, :ny].transpose(0, 2, 1)
        for k in np.flatnonzero(self.t[times] != trajectory.ts[nodes]) + times.start:
            m, (dy, carry) = self.nodes[k], np.split(found[self.nodes[k] - i].T, [ny])
            self.y[k], self.dy[k] = _at_time(trajectory, m, float(self.t[k]), dy, carry, self.dp)


def _apply(maps: Iterable[Any], dy: Array, carry: Array, dp: Array) -> tuple[Array, Array]:
    """Return the derivatives after the maps of a step."""
    for step_map in maps:
        dy, carry = step_map.forward(dy, carry, dp)
    return dy, carry


def node_indices(sol: Solution) -> Array:
    """Return the node at or before each time of a run, (n,)."""
    return sol.before(sol.t) if sol.steps else np.arange(len(sol.t))


def start_tangent(trajectory: Trajectory, dp: Array, start: bool) -> Array:
    """Return derivatives of the start, (ny, k)."""
    k, ny = trajectory.sensitivity.k, trajectory.sensitivity.ny
    dy = np.zeros((ny, dp.shape[1]))
    if k:
        dy[:, :k] = trajectory.at_start("start", lambda: _model_start_derivatives(trajectory))
    if start:
        dy[:-1, k:] = np.eye(ny - 1)
    return dy


def _model_start_derivatives(trajectory: Trajectory) -> Array:
    """Return derivatives of the mechanism's start, (ny, k); zeros for given start values of (q, v), or of s."""
    t, y, s, sensitivity = float(trajectory.ts[0]), trajectory.initial_point, trajectory.system, trajectory.sensitivity
    out, model_start, nx = np.zeros((s.ny, sensitivity.k)), np.empty(0), s.nq + s.nv
    if all(p.keeps_start and p.keeps_states for p in sensitivity.parameters.all):
        return out
    with suppress(MbdaeError):  # the loops of the start may not close
        model_start = np.concatenate(s.mechanism.start_at(t))
    if len(model_start) and np.abs(model_start - y[:nx]).max() <= COINCIDENT * (1 + np.abs(model_start).max()):
        out = sensitivity.start(t, y)
    has_given_states = (np.array(list(s.mechanism.states.values())) != y[nx:-1]).any()
    out[2 * s.nv : -1] = 0.0 if has_given_states else sensitivity.start_states()
    return out


def _at_time(trajectory: Trajectory, i: int, t: float, dy: Array, carry: Array, dp: Array) -> tuple[Array, Array]:
    """Return the point at time t after node i, and its derivatives."""
    if t == trajectory.ts[i]:
        return trajectory.ys[i], dy
    found = trajectory.core.tangent(trajectory.core.shortened_step(i, t), np.concatenate([dy, carry]).T, dp.T)
    return trajectory.point_after(i, t), found[-1, :, : len(dy)].T


def start_columns(trajectory: Trajectory) -> list[str]:
    mech, out = trajectory.system.mechanism, []
    for letter in "qv":
        for name in mech.joint_names:
            n = find_joint(mech.model, name).nv
            out += [f"{letter}0.{name}" + (f".{j + 1}" if n > 1 else "") for j in range(n)]
    return [*out, *(f"s0.{name}" for name in mech.states)]
