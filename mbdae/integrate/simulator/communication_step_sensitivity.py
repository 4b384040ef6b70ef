"""Discrete tangent and adjoint of a communication step of a simulator: derivatives of the steps that were taken."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ... import backend
from ...errors import InputError, UnknownNameError
from ...mechanism import Mechanism
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.equations.local_ode import UNIT
from ...mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value
from ...mechanism.formulations.core_description import samplers_of
from ...mechanism.inputs import Inputs
from ...mechanism.time_functions.perturbed_input import CommunicationStep, PerturbedInput
from ...solution.solution import Solution
from ...system import Array
from ..run.run_state import RunState
from ..trajectory.native_trajectory import NativeStep
from ..trajectory.trajectory import Trajectory, TrajectoryPart

BEFORE = "before "  # prefix of columns: the value of an input at the start of a communication step


class LastCommunicationStep(NamedTuple):
    """The last communication step: its first node, time there, whether a carry was restarted there, its size in s."""

    node: int
    t: float
    restarted: bool = True
    dt: float = 0.0


class CommunicationStepParameters:
    """Inputs and parameters of a simulator as parameters of its communication steps, bound once.

    Args:
        inputs: the inputs.
        names: dotted names of parameters, as of `mbdae.sensitivity`.
        point: a point (t, q, v, s) where the derivatives must be accurate.
        mode: mode of the mechanism at this point.

    Attributes:
        names: names of the parameters.
        linear: names of the inputs that are linear over a communication step.
        communication_step: start and size of the last communication step.
        bound: inputs, their values before the communication step, and parameters, as parameters of the mechanism.
        columns: names of these.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for a parameter without a derivative.
    """

    def __init__(self, inputs: Inputs, names: Sequence[str], point: Any, mode: tuple[int, ...]) -> None:
        if isinstance(names, str) or not all(isinstance(name, str) for name in names):
            raise InputError(f"parameters are given by dotted names, got {names!r:.60}")
        self.inputs, self.names, self.communication_step = inputs, tuple(names), CommunicationStep()
        self.linear = [name for name, u in inputs.user_inputs.items() if u.hold == "first"]
        values = dict.fromkeys([*inputs.user_inputs, *(BEFORE + name for name in self.linear)], UNIT)
        if names:
            if not inputs.original.source:
                raise InputError("derivatives with respect to parameters need a mechanism that was read from a file")
            self.template = LoadedModel(inputs.original)
            values |= {name: parameter_value(self.template, name) for name in names}
        self.columns = list(values)
        self.bound = Parameters(self._make, values, backend.load(), are_defaults=True, along=[(*point, mode)])

    def _make(self, values: Mapping[str, float]) -> Mechanism:
        """Return the mechanism with a changed input or parameter."""
        if not values:
            return self.inputs.mechanism
        if changed := {name: x for name, x in values.items() if name in self.names}:
            return self.inputs.replaced(self.inputs.user_inputs, self.template.make(changed))
        offsets = {name: x - UNIT for name, x in values.items()}
        varied = {
            name: PerturbedInput.of(u, self.communication_step, offsets.get(BEFORE + name, 0.0), offsets.get(name, 0.0))
            for name, u in self.inputs.user_inputs.items()
        }
        return self.inputs.replaced(varied)

    def column(self, kind: str, name: str) -> int:
        """Return the column of an "input", of an "input of first order" before the step, or of a "parameter".

        Raises:
            UnknownNameError: lists the valid names.
        """
        known = {"input": self.inputs.user_inputs, "input of first order": self.linear, "parameter": self.names}[kind]
        if name not in known:
            raise UnknownNameError(kind, name, known)
        return self.columns.index(BEFORE + name if known is self.linear else name)


class CommunicationStepSensitivity:
    """Derivatives of a communication step of a simulator.

    Args:
        run: the run.
        last: last communication step of the run.
        parameters: inputs and parameters.

    Attributes:
        sol: the nodes of the communication step, including its first one; the inputs are those of the simulator.
        trajectory: the trajectory of these nodes, recomputed on demand.

    Raises:
        InputError: for steps without a derivative; the message names the reason.
    """

    def __init__(self, run: RunState, last: LastCommunicationStep, parameters: CommunicationStepParameters) -> None:
        self.parameters, self.sol = parameters, _nodes_from(run, last.node)
        self.trajectory = Trajectory(self.sol, parameters.bound)
        if self.trajectory.n_carry and not last.restarted:
            raise InputError(
                f"method {self.trajectory.tableau.name!r} reuses v' of the previous step: for derivatives"
                " create the simulator with restart=True"
            )
        self.trajectory.restarted[0] = not self.trajectory.jumped[0]

    def _steps(self) -> list[list[TrajectoryPart]]:
        """Return the maps of each step."""
        first, *others = [list(self.trajectory.step_parts(i)) for i in range(len(self.trajectory.ts) - 1)]
        return [[*self.trajectory.carry_restart_parts(0), *first], *others]

    def tangents(self, dy: Array, dp: Array, dt: Array) -> Array:
        """Return variations of y at the nodes, (n, ny, m), for dy (ny, m) at the first one, dp (k, m) and dt (m,)."""
        carry, out = np.zeros((self.trajectory.n_carry, dy.shape[1])), [dy]
        if scaled := bool(np.any(dt)):
            self._require_autonomous()
        for (t0, t1), parts in zip(pairwise(self.trajectory.ts.tolist()), self._steps(), strict=True):
            shifted = dp + self._scaled_inputs(t0, dt) if scaled else dp
            dh = (dt * (t1 - t0) / self.parameters.communication_step.size,) if scaled else ()
            for part in parts:
                dy, carry = part.forward(dy, carry, shifted, *(dh if isinstance(part, NativeStep) else ()))
            out.append(dy)
        return np.array(out)

    def fixed_inputs(self, dt: Array) -> Array:
        """Return variations (k, m) that keep the values of inputs at a time that itself varies by dt (m,)."""
        p = self.parameters
        out = np.zeros((len(p.columns), len(dt)))
        for name in p.linear:
            change = -p.inputs.user_inputs[name].setting.rate * dt
            out[[p.columns.index(name), p.columns.index(BEFORE + name)]] = change
        return out

    def _scaled_inputs(self, t: float, dt: Array) -> Array:
        """Return variations (k, m) that keep the inputs at the stages of a step from t, while its size scales with dt.

        A stage at t' moves by (t' - t) dt/size; the variation -u' (t' - t) dt/size cancels the change of its input.
        """
        p, step = self.parameters, self.parameters.communication_step
        out = np.zeros((len(p.columns), len(dt)))
        for name in p.linear:
            change = p.inputs.user_inputs[name].setting.rate * dt / step.size
            out[p.columns.index(BEFORE + name)] = change * (t - step.start)
            out[p.columns.index(name)] = -change * (step.start + step.size - t)
        return out

    def adjoint(self, bar: Array) -> tuple[Array, Array]:
        """Return the cotangents of the first y, (ny,), and of the columns, (k,), given those of the last y, (ny,)."""
        y, carry, p = bar[:, None], np.zeros((self.trajectory.n_carry, 1)), np.zeros(len(self.parameters.columns))
        for parts in reversed(self._steps()):
            for part in reversed(parts):
                y, carry, p_of_part = part.reverse(y, carry)
                p += p_of_part[:, 0]
        return y[:, 0], p

    def _require_autonomous(self) -> None:
        """Check that equations depend on time only by inputs, so that steps scale with dt.

        Raises:
            InputError: if they do not.
        """
        m, trajectory, inputs = self.sol.mechanism, self.trajectory, list(self.parameters.inputs.user_inputs.values())
        if samplers_of(trajectory.system.laws) or any(trajectory.jumped[1:]):
            reason = "sampling times or jumps within the communication step do not scale with dt"
            raise InputError(f"{reason}: no derivative with respect to dt")
        settings = [u.setting for u in inputs]
        try:
            for u in inputs:
                u.set(u.setting._replace(rate=0.0))
            for i in (0, len(trajectory.ts) - 1):
                q, v, s, _ = np.split(trajectory.ys[i], np.cumsum([m.nq, m.nv, len(m.states)]))
                point = m.at(float(trajectory.ts[i]), q, v, s, mode=self.sol.mode(i) or trajectory.system.mode)
                names = "r_t", "h_t", "Gv_t", "gamma_t"
                time_partials = point.g_t, *(getattr(point.partials(), name) for name in names)
                if any(x.any() for x in time_partials):
                    raise InputError("forces or drivers depend on time: no derivative with respect to dt")
        finally:
            for u, setting in zip(inputs, settings, strict=True):
                u.set(setting)


def _nodes_from(run: RunState, first: int) -> Solution:
    """Return the nodes of a run from node ``first`` on, as a solution."""
    n, results = len(run.ts), dict[str, Any]()
    for source in run.sources:
        results |= source.results(run)
    changes: dict[str, Any] = {
        name: [(0, x) for i, x in by_node if i <= first][-1:] + [(i - first, x) for i, x in by_node if first < i < n]
        for name, by_node in (("in_use", run.in_use), ("modes", results.get("modes", [])))
    }
    changes |= {name: [x for x in results.get(name, ()) if x.t > run.ts[first]] for name in ("impacts", "singular")}
    changes["resets"] = [(i - first, name) for i, name in results.get("resets", ()) if i > first]
    t, y, z = np.array(run.ts[first:]), run.ys[first:n].copy(), run.zs[first:n].copy()
    settings, stats = {**run.settings, **run.stepper.settings()}, {"backend": run.stepper.backend}
    return Solution(run.problem, t, y, z, "finished", "", stats, settings, **changes)
