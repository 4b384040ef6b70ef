"""The flow over a segment of a period, an interval of multiple shooting, and its tangent."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....errors import InputError
from ....integrate.events.event import Event
from ....integrate.solve import solve
from ....integrate.trajectory.trajectory import Trajectory
from ....mechanism import Mechanism
from ....mechanism.discrete_sensitivity.parameter_partials import Parameters
from ....solution.solution import Solution
from ....system import Array
from ...sensitivity.sensitivity import run_tangents

LONGEST = 20.0  # multiple of the expected duration: a run must return to its section within it


@dataclass(frozen=True)
class FlowTangent:
    """The tangent of a segment of a period.

    Attributes:
        fixed: tangent of the end at a fixed time, (ny, m).
        dt: tangent of the time at which the section is crossed, (m,); zeros for a fixed duration.
        rate: y' at the end, in the tangent, (ny,).
        first_rate: y' at the first node, (ny,).
        start: tangent of the first node before sampling by controllers, (ny, m).
        energy: gradient of the energy at the first node, (ny,).
    """

    fixed: Array
    dt: Array
    rate: Array
    first_rate: Array
    start: Array
    energy: Array

    @property
    def on_section(self) -> Array:
        """Tangent of the end on the section, (ny, m)."""
        return self.fixed + np.outer(self.rate, self.dt)


@dataclass
class Flow:
    """Runs of a mechanism with their tangents, for k varied parameters.

    Attributes:
        mechanism: the mechanism.
        parameters: the varied parameters, bound to the mechanism.
        options: options of `mbdae.solve`.
    """

    mechanism: Mechanism
    parameters: Parameters
    options: Mapping[str, Any] = field(default_factory=dict)

    def run(self, t: float, y: Array, duration: float, section: str | None) -> Solution:
        """Return the run over a duration, or up to the next crossing of a section.

        Raises:
            InputError: if the run fails, or does not reach the section, or crosses it in a jump.
        """
        m = self.mechanism
        q, v, s, _ = np.split(y, np.cumsum([m.nq, m.nv, len(m.states)]))
        events = [Event(section, terminal=True)] if section else None
        end = t + duration * (LONGEST if section else 1.0)
        sol = solve(m, (t, end), q, v, s, events=events, **self.options)
        if section and sol.status == "finished":
            raise InputError(f"the motion does not reach the section {section!r} within {end - t:.3g} s")
        if sol.status not in ("finished", "event", "doubtful"):
            raise InputError(f"the run over a period stopped at t = {sol.t[-1]:.9g} s: {sol.message}")
        if section and len(sol.nodes[0]) > 1 and sol.nodes[0][-1] == sol.nodes[0][-2]:
            raise InputError(
                f"the section {section!r} is crossed in a jump, at t = {sol.t[-1]:.9g} s{_cause(sol)}: take another"
                " signal or level"
            )
        return sol

    def tangent(self, sol: Solution, dy: Array, section: str | None) -> FlowTangent:
        """Return the tangent of a run for variations dy (ny, m) of the start; the last k are those of parameters.

        Raises:
            InputError: for runs without derivatives.
        """
        k, t, y = len(self.parameters), float(sol.nodes[0][0]), sol.nodes[1][0]
        trajectory = Trajectory(sol, self.parameters)
        dp = np.eye(k, dy.shape[1], dy.shape[1] - k)
        found = run_tangents(trajectory, tuple(map(str, range(dy.shape[1]))), dy, dp, section)
        trajectory.enter_node(0)
        first_rate = trajectory.system.derivative(t, y)[0]
        trajectory.enter_node(len(trajectory.ts) - 1)
        rate = trajectory.system.derivative(float(sol.t[-1]), sol.y[-1])[0]
        dt, energy = found.dt[-1], trajectory.sensitivity.energy(*trajectory.system.split(y)).sum(axis=0)[: len(dy)]
        fixed = found.dy[-1] - np.outer(rate, dt)
        start, states = found.dy[0].copy(), slice(2 * self.mechanism.nv, None)
        start[states] = dy[states]  # before sampling by controllers
        return FlowTangent(fixed, dt, rate, first_rate, start, energy)


def _cause(sol: Solution) -> str:
    """Return the names of the impact or of the event at the end of a run."""
    end, last = sol.t[-1], len(sol.nodes[0]) - 1
    names = [name for x in sol.impacts if x.t == end for name in x.where] + [x for i, x in sol.resets if i == last]
    return f" by {' and '.join(map(repr, dict.fromkeys(names)))}" if names else ""


def require_same_rows(before: Solution, after: Solution) -> None:
    """Require the same active rows at the end of a run and at the start of the next: local coordinates depend on them.

    Raises:
        InputError: names the first switch that differs, with advice.
    """
    last, first = before.mode(len(before.nodes[0]) - 1), after.mode(0)
    for switch, x, y in zip(before.mechanism.switches, last, first, strict=True):
        if switch.active_rows(x) != switch.active_rows(y):
            where = (
                f"at t = {before.t[-1]:.9g} s, the end of a segment, {switch.name!r} is {switch.states[x]}"
            )
            raise InputError(f"{where}, and {switch.states[y]} at the start of the next: begin at another phase")
