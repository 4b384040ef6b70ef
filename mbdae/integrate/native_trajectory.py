"""Steps of a trajectory in the compiled core, many at once: carries, tangents and adjoints."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import backend
from ..errors import InputError, NotCompiled
from ..mechanism.discrete_sensitivity.core_parameters import bind_parameters
from ..mechanism.discrete_sensitivity.parameter_partials import Parameters
from ..mechanism.formulations.compiled_systems import CompiledSystem
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
        trace: trajectory of a run.
        parameters: the varied parameters of its mechanism.

    Attributes:
        of: the same.
        parameters: those of the core.

    Raises:
        InputError: without the core, and for features that it does not support.
    """

    def __init__(self, trace: "Trajectory", parameters: Parameters) -> None:
        system = trace.system
        if backend.load() is None:
            raise InputError(f"derivatives of runs need the compiled core of mbdae; {backend.status()}")
        try:
            if not isinstance(system, CompiledSystem):  # which raises the reason
                system = system.mechanism.system(system.formulation, native=backend.load())
            self.parameters = bind_parameters(system, parameters)
        except NotCompiled as e:
            raise InputError(f"derivatives of runs need the compiled core, which does not compute {e}") from None
        self.trace, self.core, self.of = trace, system.core, parameters
        self.method = system.method(trace.tableau)
        self.run = system.native.Run()
        self.run.project, self.run.adaptive, self.run.tolerated = trace.project, trace.controlled, TOLERATED
        self.run.nothing = TINY
        if trace.controlled:
            control = self.run.control
            control.rtol, control.atol = trace.stepper.rtol, np.atleast_1d(trace.stepper.atol).tolist()
            control.nothing = TINY
        self.blocked: set[int] = set()  # steps that are repeated in Python, for their carries

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
        if found is None:
            self.blocked |= set(range(i, j))
            return None
        carries, renewed, steps, end = found
        points = [*ys[1:steps], end] if steps else []
        states = [State(y, carry) for y, carry in zip(points, carries[1:], strict=False)]
        return RecomputedStates(states, renewed[1 : steps + 1], i + steps == j)

    def adjoint(self, nodes: NodeRange, extra: Array, bar: Array) -> tuple[Array, Array]:
        """Return the cotangents of y and carry at the first node, (ny + nc,), and of the parameters, (k,).

        Args:
            nodes: connected by steps only.
            extra: cotangents added at each of them, (m + 1, ny + nc); ignored at the first and the last.
            bar: the cotangents at the last.
        """
        given = self.parameters, self.method, self.trace.halved, self.trace.project
        along = np.ascontiguousarray(extra), np.ascontiguousarray(bar)
        return self._repeated(nodes, self.core.adjoint(*given, *nodes[1:], *along, self._friction))

    def tangent(self, nodes: NodeRange, first: Array, dp: Array, dh: Array | None = None) -> Array:
        """Return the variations of y and carry at the nodes, (m + 1, d, ny + nc).

        Args:
            nodes: connected by steps only.
            first: variations at the first of them, (d, ny + nc).
            dp: of the parameters, (d, k).
            dh: of the size of each step, (d,).
        """
        given = self.parameters, self.method, self.trace.halved, self.trace.project
        along = np.ascontiguousarray(first), np.ascontiguousarray(dp)
        return self._repeated(nodes, self.core.tangent(*given, *nodes[1:], *along, dh, self._friction))

    @property
    def _friction(self) -> Any:
        """Partials of friction that depends on multipliers, which the core takes from Python."""
        return self.trace.sensitivity.friction if self.trace.system.sliding else None

    def _repeated(self, nodes: NodeRange, found: Any) -> Any:
        """Return what the core found.

        Raises:
            InputError: if it could not repeat or differentiate the steps.
        """
        if found is None:
            t0, t1 = nodes.ts[[0, -1]]
            self.trace.repeat_between(t0, t1)  # which knows why it fails
            what = f"the steps from t = {t0:.9g} s to {t1:.9g} s have no derivatives"
            raise InputError(f"{what}: numbers are not finite, or the equations of a stage are singular")
        return found


class NativeStep(NamedTuple):
    """The step from node i to the next one, with the projection of its end; variations are columns."""

    core: NativeTrajectory
    i: int

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array | None = None) -> tuple[Array, Array]:
        """Return the variations of y and of the carry, for dp (k, m) and dh (m,) of the step size."""
        nodes, ny = self.core.nodes(self.i, self.i + 1), len(dy)
        found = self.core.tangent(nodes, np.concatenate([dy, carry]).T, dp.T, dh)[-1].T
        return found[:ny], found[ny:]

    def reverse(self, y: Array, carry: Array) -> tuple[Array, Array, Array]:
        """Return the cotangents of y, of the carry and of the parameters, (..., 1)."""
        bar = np.concatenate([y, carry])[:, 0]
        at, p = self.core.adjoint(self.core.nodes(self.i, self.i + 1), np.zeros((2, len(bar))), bar)
        return at[: len(y), None], at[len(y) :, None], p[:, None]
