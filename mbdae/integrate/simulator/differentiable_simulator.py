"""Tangent and adjoint of the last communication step of a simulator."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, require
from ...mechanism import Mechanism
from ...mechanism.inputs import Inputs
from ...system import Array
from ..run.run_state import RunState
from .communication_step_sensitivity import (
    CommunicationStepParameters,
    CommunicationStepSensitivity,
    LastCommunicationStep,
)


class Tangent(NamedTuple):
    """Variations of the state at the end of a communication step: of q in the tangent (nv,), of v (nv,) and s (ns,).

    With m directions, (nv, m), (nv, m), (ns, m).
    """

    q: Array
    v: Array
    s: Array


class Adjoint(NamedTuple):
    """Derivatives of <q, q_1> + <v, v_1> + <s, s_1>, with the state (q_1, v_1, s_1) at the end of a communication step.

    Attributes:
        q, v, s: with respect to the state at the start, (nv,), (nv,), (ns,), that of q in the tangent.
        inputs: with respect to the value of each input that was set for the step.
        inputs_before: with respect to the value at the start, of each input with ``hold = "first"``.
        parameters: with respect to the given parameters.
        dt: with respect to the size of the step; None unless requested.
    """

    q: Array
    v: Array
    s: Array
    inputs: dict[str, float]
    inputs_before: dict[str, float]
    parameters: dict[str, float]
    dt: float | None


class DifferentiableSimulator:
    """Simulator with derivatives of its last communication step, (q_0, v_0, s_0, u, p) -> (q_1, v_1, s_1).

    The derivatives are those of the computed steps, with their sizes and rows in use, exact to rounding (see
    `mbdae.sensitivity`). The carry of the method, if it has one, must be a function of the state at the start: either
    an input jumped, or the simulator has ``restart=True``.
    """

    mechanism: Mechanism
    inputs: Inputs
    status: str
    _last: LastCommunicationStep | None = None
    _bound: CommunicationStepParameters | None = None
    _differentiated: CommunicationStepSensitivity | None = None

    @property
    def _run(self) -> RunState:
        """The run, after all its steps are recorded."""
        raise NotImplementedError

    def tangent(
        self,
        dq: Array | None = None,
        dv: Array | None = None,
        ds: Array | None = None,
        *,
        inputs: Mapping[str, Any] | None = None,
        inputs_before: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        dt: Any = 0.0,
    ) -> Tangent:
        """Return the derivative of the last communication step along a direction; omitted variations are 0.

        Args:
            dq: variation of q at the start, in the tangent, (nv,), or (nv, m); it may violate closures.
            dv: variation of v at the start, (nv,) or (nv, m).
            ds: variation of s at the start, (ns,) or (ns, m).
            inputs: variations of the inputs that were set for the step, by name; numbers or (m,).
            inputs_before: variations of inputs with ``hold = "first"`` at the start.
            parameters: variations of parameters, by dotted name; they do not change the state at the start.
            dt: variation of the size; all steps of the method scale with it.

        Raises:
            InputError: before the first step, if modes change in it or a terminal event ended it; for wrong shapes, a
                method without derivatives, and without the compiled core.
            UnknownNameError: for an unknown input or parameter.
        """
        variations = {"input": inputs or {}, "input of first order": inputs_before or {}, "parameter": parameters or {}}
        _require_tables(variations)
        last = self.differentiated(tuple(variations["parameter"]))
        p, m = last.parameters, self.mechanism
        state: dict[str, tuple[Any, int]] = {"dq": (dq, m.nv), "dv": (dv, m.nv), "ds": (ds, len(m.states))}
        numbers = [x for table in variations.values() for x in table.values()] + [dt]
        widths = {np.shape(x)[-1] for x, _ in state.values() if np.ndim(x) > 1}
        widths |= {np.shape(x)[-1] for x in numbers if np.ndim(x)}
        if len(widths) > 1:
            listed = ", ".join(map(str, sorted(widths)))
            raise InputError(f"variations must have the same number of columns, got {listed}")
        width = next(iter(widths), 1)
        dy = np.vstack([*(_columns(name, x, n, width) for name, (x, n) in state.items()), np.zeros((1, width))])
        dp = np.zeros((len(p.columns), width))
        for kind, table in variations.items():
            for name, x in table.items():
                dp[p.column(kind, name)] = _columns(f"{kind} {name!r}", np.reshape(x, (1, -1)), 1, width)[0]
        dy_end = last.tangents(dy, dp, _columns("dt", np.reshape(dt, (1, -1)), 1, width)[0])[-1]
        parts = np.split(dy_end if widths else dy_end[:, 0], [m.nv, 2 * m.nv, len(dy_end) - 1])
        return Tangent(*parts[:3])

    def adjoint(
        self,
        q: Array | None = None,
        v: Array | None = None,
        s: Array | None = None,
        *,
        parameters: Sequence[str] = (),
        dt: bool = False,
    ) -> Adjoint:
        """Return the derivatives of <q, q_1> + <v, v_1> + <s, s_1>: the transpose of `tangent`, to rounding.

        Args:
            q: weights of q at the end, in the tangent, (nv,); 0 if omitted.
            v: weights of v, (nv,).
            s: weights of s, (ns,).
            parameters: dotted names.
            dt: whether to differentiate also with respect to the size of the communication step.

        Raises:
            InputError: as for `tangent`.
            UnknownNameError: for an unknown parameter.
        """
        last, m = self.differentiated(parameters), self.mechanism
        state = {"q": (q, m.nv), "v": (v, m.nv), "s": (s, len(m.states))}
        bar = np.vstack([*(_columns(name, x, n, 1) for name, (x, n) in state.items()), np.zeros((1, 1))])[:, 0]
        y, p = last.adjoint(bar)
        dt_derivative = None
        if dt:
            zeros = np.zeros((len(bar), 1)), np.zeros((len(p), 1))
            dt_derivative = float(bar @ last.tangents(*zeros, np.ones(1))[-1, :, 0])
        gradient, column = [float(x) for x in p], last.parameters.column
        return Adjoint(
            y[: m.nv], y[m.nv : 2 * m.nv], y[2 * m.nv : -1],
            {name: gradient[column("input", name)] for name in self.inputs.user_inputs},
            {name: gradient[column("input of first order", name)] for name in last.parameters.linear},
            {name: gradient[column("parameter", name)] for name in parameters}, dt_derivative,
        )  # fmt: skip

    def differentiated(self, parameters: Sequence[str] = ()) -> CommunicationStepSensitivity:
        """Return the last communication step with derivatives at all nodes, in columns of inputs and these parameters.

        Raises:
            InputError: see `tangent`.
            UnknownNameError: for an unknown parameter.
        """
        last, run = self._last, self._run
        require(parameters, Iterable, "parameters are given by dotted names")
        if last is None:
            raise InputError("nothing to differentiate: the simulator has not advanced since its start or restore")
        if self.status == "event":
            raise InputError("the last step ended in an event, whose time varies: it has no derivative at fixed dt")
        if self._bound is None or self._bound.names != tuple(parameters):
            m = self.mechanism
            mode = self._run.system.mode  # type: ignore[attr-defined]
            q, v, s, _ = np.split(run.ys[last.node], np.cumsum([m.nq, m.nv, len(m.states)]))
            self._bound = CommunicationStepParameters(self.inputs, parameters, (last.t, q, v, s), mode)
            self._differentiated = None
        step = self._bound.communication_step
        step.start, step.size = last.t, last.dt
        if self._differentiated is None:
            self._differentiated = CommunicationStepSensitivity(run, last, self._bound)
        return self._differentiated


def _require_tables(variations: Mapping[str, object]) -> None:
    for kind, table in variations.items():
        require(table, Mapping, f"variations of each {kind} are given by name, {{name: number}}")


def _columns(name: str, x: object, n: int, m: int) -> Array:
    """Return variations of n numbers in m directions, (n, m), given as (n, m), or (n,) for all directions; None is 0.

    Raises:
        InputError: for wrong shapes, or numbers that are not finite.
    """
    try:
        columns = np.zeros((n, 1)) if x is None else np.asarray(x, float)
        columns = columns[:, None] if columns.ndim == 1 else columns
    except (TypeError, ValueError):
        columns = np.empty((0, 0))
    if columns.shape not in ((n, 1), (n, m)) or not np.isfinite(columns).all():
        raise InputError(f"{name} must be {n} finite numbers{f', or {n} rows of {m}' * (m > 1)}, got {x!r:.60}")
    return np.broadcast_to(columns, (n, m))
