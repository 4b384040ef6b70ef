"""Carries, tangents and adjoints of sequences of steps of a trajectory, in the compiled core."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ... import backend
from ...errors import InputError, NotCompiled
from ...mechanism.discrete_sensitivity.core_parameters import bind_parameters
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.formulations.compiled_systems import CompiledSystem
from ...system import Array, State
from ...tolerances import TINY
from ..steppers.fixed import FIXED_STEP_TOLERANCE

if TYPE_CHECKING:
    from ..._native import Parameters as NativeParameters
    from .trajectory import Trajectory

STEPS_PER_CALL = 1000  # between checks for Ctrl-C


class NodeRange(NamedTuple):
    """Consecutive nodes of a trajectory: the steps between them, times (m + 1,), points, and carries."""

    steps: range
    ts: Array
    ys: Array
    carries: Array


class RecomputedStates(NamedTuple):
    """States after each step, whether the carry was restarted there, and whether all steps were reproduced."""

    states: list[State]
    restarted: list[int]
    complete: bool


class NativeTrajectory:
    """Sequences of steps of a trajectory in the compiled core; a sequence contains no jumps or row changes.

    Args:
        trajectory: trajectory of a run.
        parameters: the varied parameters of its mechanism.

    Attributes:
        varied: the varied parameters.
        parameters: the varied parameters, bound to the core.

    Raises:
        InputError: without the core, and for features that the core does not support.
    """

    def __init__(self, trajectory: "Trajectory", parameters: Parameters) -> None:
        system = trajectory.system
        if backend.load() is None:
            raise InputError(f"derivatives of runs need the compiled core of mbdae; {backend.status()}")
        try:
            if not isinstance(system, CompiledSystem):  # raises NotCompiled with the reason
                system = system.mechanism.system(system.formulation, native=backend.load())
            self.parameters = bind_parameters(system, parameters)
        except NotCompiled as e:
            raise InputError(f"derivatives of runs need the compiled core, which does not compute {e}") from None
        self.trajectory, self.system, self.core, self.varied = trajectory, system, system.core, parameters
        self._parameters_of_mode = {system.mode: self.parameters}
        self.method = system.method(trajectory.tableau)
        self.run = system.native.Run()
        self.run.project, self.run.adaptive, self.run.tolerated_move = (
            trajectory.project,
            trajectory.controlled,
            FIXED_STEP_TOLERANCE,
        )
        self.run.tiny = TINY
        if trajectory.controlled:
            control = self.run.control
            control.rtol, control.atol = trajectory.stepper.rtol, np.atleast_1d(trajectory.stepper.atol).tolist()
            control.tiny = TINY
        self.blocked: set[int] = set()  # steps that Python repeats to obtain their carries

    def enter_mode(self) -> "NativeParameters":
        """Return the parameters bound to the core in its mode."""
        mode = self.system.mode
        if mode not in self._parameters_of_mode:
            self._parameters_of_mode[mode] = bind_parameters(self.system, self.varied)
        self.parameters = self._parameters_of_mode[mode]
        return self.parameters

    def segment_end(self, i: int, exclude_last: bool = False) -> int:
        """Return the last node of the sequence of steps that starts at node i; i itself if there is no such step.

        Args:
            i: a node.
            exclude_last: whether to exclude the last step of the run, because its size varies.
        """
        length = self.trajectory.checkpoints.length if self.trajectory.checkpoints else STEPS_PER_CALL
        last, j = min(len(self.trajectory.ts) - 1 - exclude_last, (i // length + 1) * length), i
        while j < last and self.is_core_step(j) and not (j > i and self.trajectory.restarted[j]):
            j += 1
        return j

    def segment_start(self, i: int) -> int:
        """Return the first node of the sequence of steps that ends at node i; i itself if there is no such step."""
        length = self.trajectory.checkpoints.length if self.trajectory.checkpoints else STEPS_PER_CALL
        first, j = (i - 1) // length * length, i
        while j > max(0, first) and self.is_core_step(j - 1) and not (j < i and self.trajectory.restarted[j]):
            j -= 1
        return j

    def is_core_step(self, i: int) -> bool:
        """Return whether a step of the core leads from node i to the next node, except for a restarted carry."""
        return not (self.trajectory.jumped[i] or i + 1 in self.trajectory.changes or i in self.blocked)

    def nodes(self, i: int, j: int) -> NodeRange:
        """Return nodes i, ..., j; the workspace then uses the rows of their steps."""
        trajectory, carries = self.trajectory, np.zeros((j - i + 1, self.trajectory.n_carry))
        if trajectory.checkpoints:
            carries[:-1] = trajectory.checkpoints.carries_between(i, j)
        trajectory.enter_node(i)
        return NodeRange(
            range(i, j), np.ascontiguousarray(trajectory.ts[i : j + 1]), np.array(trajectory.ys[i : j + 1]), carries
        )

    def shortened_step(self, i: int, t: float) -> NodeRange:
        """Return node i and the end of a shorter step from node i, at time t."""
        trajectory = self.trajectory
        _, ts, ys, carries = self.nodes(i, i + 1 if i + 1 < len(trajectory.ts) else i)
        return NodeRange(range(i, i + 1), np.array([ts[0], t]), np.array([ys[0], ys[0]]), np.array([carries[0]] * 2))

    def recompute(self, i: int, j: int, state: State, tolerances: tuple[float, float]) -> RecomputedStates | None:
        """Recompute the states after node i up to node j, or up to the end of the sequence of steps.

        The last point is recomputed; the points before it are those of the run.
        """
        j = min(j, self.segment_end(i))
        if j == i:
            return None
        trajectory = self.trajectory
        trajectory.enter_node(i)
        ts, ys = np.ascontiguousarray(trajectory.ts[i : j + 1]), np.array(trajectory.ys[i : j + 1])
        ys[0] = state.y
        half_steps = trajectory.uses_half_steps
        result = self.core.recompute(self.method, half_steps, self.run, ts, ys, state.carry, *tolerances)
        if result is None:
            self.blocked |= set(range(i, j))
            return None
        carries, restarted, steps, end = result
        points = [*ys[1:steps], end] if steps else []
        states = [State(y, carry) for y, carry in zip(points, carries[1:], strict=False)]
        return RecomputedStates(states, restarted[1 : steps + 1], i + steps == j)

    def adjoint(self, nodes: NodeRange, extra: Array, bars: Array) -> tuple[Array, Array]:
        """Return the cotangents of y and carry at the first node, (costs, ny + nc), and of the parameters, (costs, k).

        Args:
            nodes: nodes of a sequence of steps.
            extra: cotangents that are added at each node, (m + 1, costs, ny + nc); ignored at the first and the last.
            bars: the cotangents at the last node, (costs, ny + nc).
        """
        settings = self.parameters, self.method, self.trajectory.uses_half_steps, self.trajectory.project
        vectors = np.ascontiguousarray(extra), np.ascontiguousarray(bars)
        return self._checked(nodes, self.core.adjoint(*settings, *nodes[1:], *vectors, self._friction))

    def tangent(self, nodes: NodeRange, first: Array, dp: Array, dh: Array | None = None) -> Array:
        """Return the tangents of y and carry at the nodes, (m + 1, d, ny + nc).

        Args:
            nodes: nodes of a sequence of steps.
            first: tangents of y and carry at the first node, (d, ny + nc).
            dp: tangents of the parameters, (d, k).
            dh: tangents of the size of each step, (d,).
        """
        settings = self.parameters, self.method, self.trajectory.uses_half_steps, self.trajectory.project
        vectors = np.ascontiguousarray(first), np.ascontiguousarray(dp)
        return self._checked(nodes, self.core.tangent(*settings, *nodes[1:], *vectors, dh, self._friction))

    @property
    def _friction(self) -> Any:
        """Partials of friction that depends on multipliers; the core calls Python for them."""
        return self.trajectory.sensitivity.friction if self.trajectory.system.closure_friction else None

    def _checked(self, nodes: NodeRange, result: object) -> Any:
        """Return a result of the core if there is one.

        Raises:
            InputError: if the core could not repeat or differentiate the steps.
        """
        if result is None:
            t0, t1 = nodes.ts[[0, -1]]
            self.trajectory.repeat_between(t0, t1)  # raises an error with the reason, if it fails in Python too
            steps = f"the steps from t = {t0:.9g} s to {t1:.9g} s have no derivatives"
            raise InputError(f"{steps}: numbers are not finite, or the equations of a stage are singular")
        return result


class NativeStep(NamedTuple):
    """The step from node i to the next node, with the projection of its end; tangents are columns."""

    core: NativeTrajectory
    i: int

    def forward(self, dy: Array, carry: Array, dp: Array, dh: Array | None = None) -> tuple[Array, Array]:
        """Return the tangents of y and of the carry, for dp (k, m) and the change dh (m,) of the step size."""
        nodes, ny = self.core.nodes(self.i, self.i + 1), len(dy)
        tangent = self.core.tangent(nodes, np.concatenate([dy, carry]).T, dp.T, dh)[-1].T
        return tangent[:ny], tangent[ny:]

    def reverse(self, y: Array, carry: Array) -> tuple[Array, Array, Array]:
        """Return the cotangents of y, of the carry and of the parameters, (..., costs)."""
        bars = np.concatenate([y, carry]).T
        at, p = self.core.adjoint(self.core.nodes(self.i, self.i + 1), np.zeros((2, *bars.shape)), bars)
        return at[:, : len(y)].T, at[:, len(y) :].T, p.T
