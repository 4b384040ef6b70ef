"""Many steps of a trajectory at once, in the compiled core: carries, tangents and adjoints."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import NotCompiled
from ..mechanism.discrete_sensitivity.core_parameters import bind_parameters
from ..mechanism.formulations.compiled_systems import CompiledSystem
from ..methods import Tableau
from ..system import Array, State
from ..tolerances import TINY
from .steppers.fixed import TOLERATED

if TYPE_CHECKING:
    from .trajectory import Trajectory

MANY = 1000  # steps per call, between checks for Ctrl-C


class NodeRange(NamedTuple):
    """Consecutive nodes of a trajectory: the steps from them, times (m + 1,), points, and carries."""

    steps: range
    ts: Array
    ys: Array
    carries: Array


class RecomputedStates(NamedTuple):
    """States after some steps, where the carry was restarted, and whether all could be repeated."""

    states: list[State]
    renewed: list[int]
    complete: bool


class NativeTrajectory:
    """Steps of a trajectory in the compiled core, from node i to node j > i without other maps between.

    Args:
        trace: trajectory of a run in a workspace of the core.

    Raises:
        NotCompiled: for features that the core does not support.
    """

    def __init__(self, trace: "Trajectory", system: CompiledSystem) -> None:
        self.trace, self.core = trace, system.core
        self.parameters = bind_parameters(system, trace.sensitivity.parameters)
        self.method = system.method(trace.tableau)
        self.run = system.native.Run()
        self.run.project, self.run.adaptive, self.run.tolerated = trace.project, trace.controlled, TOLERATED
        self.run.nothing = TINY
        if trace.controlled:
            control = self.run.control
            control.rtol, control.atol = trace.stepper.rtol, np.atleast_1d(trace.stepper.atol).tolist()
            control.nothing = TINY
        self.blocked: set[int] = set()  # steps that the core could not repeat

    def after(self, i: int, ends: bool = False) -> int:
        """Return the last node reached from node i by steps only; i itself where the core cannot continue.

        Args:
            i: a node.
            ends: exclude the last step of the run, whose size varies.
        """
        kept = self.trace.checkpoints.length if self.trace.checkpoints else MANY
        last, j = min(len(self.trace.ts) - 1 - ends, (i // kept + 1) * kept), i
        while j < last and self.is_plain_step(j) and not (j > i and self.trace.renewed[j]):
            j += 1
        return j

    def before(self, i: int) -> int:
        """Return the first node from which only steps lead to node i; i itself if there is none."""
        kept = self.trace.checkpoints.length if self.trace.checkpoints else MANY
        first, j = (i - 1) // kept * kept, i
        while j > max(0, first) and self.is_plain_step(j - 1) and not (j < i and self.trace.renewed[j]):
            j -= 1
        return j

    def is_plain_step(self, i: int) -> bool:
        """Return whether node i leads to the next by a step of the core, apart from a restarted carry."""
        return not (self.trace.jumped[i] or i + 1 in self.trace.changes or i in self.blocked)

    def nodes(self, i: int, j: int) -> NodeRange:
        """Return nodes i .. j, and use the rows of their steps."""
        trace, carries = self.trace, np.zeros((j - i + 1, self.trace.n_carry))
        if trace.checkpoints:
            carries[:-1] = trace.checkpoints.carried(i, j)
        trace.enter_node(i)
        return NodeRange(range(i, j), np.ascontiguousarray(trace.ts[i : j + 1]), np.array(trace.ys[i : j + 1]), carries)

    def short(self, i: int, t: float) -> NodeRange:
        """Return node i and the end of a shorter step from there."""
        trace = self.trace
        _, ts, ys, carries = self.nodes(i, i + 1 if i + 1 < len(trace.ts) else i)
        return NodeRange(range(i, i + 1), np.array([ts[0], t]), np.array([ys[0], ys[0]]), np.array([carries[0]] * 2))

    def recompute(self, i: int, j: int, state: State, near: tuple[float, float]) -> RecomputedStates | None:
        """Recompute states from node i to j, or as far as only steps lead there.

        Only the last point is the recomputed one; before it those of the run are used.
        """
        j = min(j, self.after(i))
        if j == i:
            return None
        trace = self.trace
        trace.enter_node(i)
        ts, ys = np.ascontiguousarray(trace.ts[i : j + 1]), np.array(trace.ys[i : j + 1])
        ys[0] = state.y
        found = self.core.recompute(self.method, trace.halved, self.run, ts, ys, state.carry, *near)
        found = self._tried(range(i, j), found)
        if found is None:
            return None
        carries, renewed, steps, end = found
        points = [*ys[1:steps], end] if steps else []
        states = [State(y, carry) for y, carry in zip(points, carries[1:], strict=False)]
        return RecomputedStates(states, renewed[1 : steps + 1], i + steps == j)

    def adjoint(self, nodes: NodeRange, extra: Array, bar: Array) -> tuple[Array, Array] | None:
        """Return the cotangents of y and carry at the first node, (ny + nc,), and of the parameters, (k,).

        Args:
            nodes: connected by steps only.
            extra: cotangents added at each of them, (m + 1, ny + nc); ignored at the first and the last.
            bar: the cotangents at the last.
        """
        given = self.parameters, self.method, self.trace.halved, self.trace.project
        found = self.core.adjoint(*given, *nodes[1:], extra, bar)
        return self._tried(nodes.steps, found)

    def tangent(self, nodes: NodeRange, first: Array, dp: Array) -> Array | None:
        """Return the variations of y and carry at the nodes, (m + 1, d, ny + nc).

        Args:
            nodes: connected by steps only.
            first: variations at the first of them, (d, ny + nc).
            dp: of the parameters, (d, k).
        """
        given = self.parameters, self.method, self.trace.halved, self.trace.project
        found = self.core.tangent(*given, *nodes[1:], np.ascontiguousarray(first), np.ascontiguousarray(dp))
        return self._tried(nodes.steps, found)

    def _tried(self, steps: range, found: Any) -> Any:
        if found is None:  # Python takes over, or reports the error
            self.blocked |= set(steps)
        return found


def native_trajectory(trace: "Trajectory") -> NativeTrajectory | None:
    """Return the steps of a trajectory in the core; None where Python computes them."""
    if not isinstance(trace.system, CompiledSystem) or not isinstance(trace.tableau, Tableau):
        return None
    if trace.system.sliding:  # the core has no partials of friction that depends on multipliers
        return None
    try:
        return NativeTrajectory(trace, trace.system)
    except NotCompiled:
        return None
