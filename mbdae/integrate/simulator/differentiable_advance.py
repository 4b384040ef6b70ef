"""Tangent and adjoint of the last advance of a simulator."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, require
from ...mechanism import Mechanism
from ...mechanism.inputs import Inputs
from ...system import Array
from ..run.run_state import RunState
from .advance_sensitivity import AdvanceParameters, AdvanceSensitivity, LastAdvance


class Tangent(NamedTuple):
    """Variations of the state at the end of an advance: of q in the tangent (nv,), of v (nv,) and s (ns,).

    With m directions, (nv, m), (nv, m), (ns, m).
    """

    q: Array
    v: Array
    s: Array


class Adjoint(NamedTuple):
    """Derivatives of <q, q_1> + <v, v_1> + <s, s_1> of the state at the end of an advance.

    Attributes:
        q, v, s: by the state before, (nv,), (nv,), (ns,), that of q in the tangent.
        inputs: by the value of each input that was set for the advance.
        inputs_before: by the value before, of each input with ``hold = "first"``.
        parameters: by the given parameters.
        dt: by the length of the advance; None unless requested.
    """

    q: Array
    v: Array
    s: Array
    inputs: dict[str, float]
    inputs_before: dict[str, float]
    parameters: dict[str, float]
    dt: float | None


class DifferentiableAdvance:
    """The last advance (q_0, v_0, s_0, u, p) -> (q_1, v_1, s_1) of a simulator, and its derivatives.

    They are those of the steps that were taken, with their sizes and rows in use, exact to rounding (see
    `mbdae.sensitivity`). The carry of the method, if it has one, is a function of the state before: either an input
    jumped, or the simulator has ``restart=True``.
    """

    mechanism: Mechanism
    inputs: Inputs
    status: str
    _last: LastAdvance | None = None
    _bound: AdvanceParameters | None = None
    _differentiated: AdvanceSensitivity | None = None

    @property
    def _run(self) -> RunState:
        """The run, all its steps recorded."""
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
        """Return the derivative of the last advance along a direction; omitted variations are 0.

        Args:
            dq: of q before, in the tangent, (nv,), or (nv, m) for m directions; it need not satisfy closures.
            dv: of v before, (nv,) or (nv, m).
            ds: of s before, (ns,) or (ns, m).
            inputs: of the values of inputs that were set for the advance, by name; numbers or (m,).
            inputs_before: of inputs with ``hold = "first"`` at its start.
            parameters: of parameters, by dotted name; they do not change the state before.
            dt: of its length; all its steps scale with it.

        Raises:
            InputError: without an advance to differentiate, or where its modes change or a terminal event ended it;
                for wrong shapes, for a method without derivatives, and without the compiled core.
            UnknownNameError: for an unknown input or parameter.
        """
        given = {"input": inputs or {}, "input of first order": inputs_before or {}, "parameter": parameters or {}}
        _require_tables(given)
        last = self.differentiated(tuple(given["parameter"]))
        p, m = last.parameters, self.mechanism
        state: dict[str, tuple[Any, int]] = {"dq": (dq, m.nv), "dv": (dv, m.nv), "ds": (ds, len(m.states))}
        numbers = [x for table in given.values() for x in table.values()] + [dt]
        many = {np.shape(x)[-1] for x, _ in state.values() if np.ndim(x) > 1}
        many |= {np.shape(x)[-1] for x in numbers if np.ndim(x)}
        if len(many) > 1:
            widths = ", ".join(map(str, sorted(many)))
            raise InputError(f"variations must have the same number of columns, got {widths}")
        width = next(iter(many), 1)
        dy = np.vstack([*(_columns(name, x, n, width) for name, (x, n) in state.items()), np.zeros((1, width))])
        dp = np.zeros((len(p.columns), width))
        for kind, table in given.items():
            for name, x in table.items():
                dp[p.column(kind, name)] = _columns(f"{kind} {name!r}", np.reshape(x, (1, -1)), 1, width)[0]
        found = last.tangents(dy, dp, _columns("dt", np.reshape(dt, (1, -1)), 1, width)[0])[-1]
        parts = np.split(found if many else found[:, 0], [m.nv, 2 * m.nv, len(found) - 1])
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
            dt: whether to differentiate by the length of the advance, too.

        Raises:
            InputError: as for `tangent`.
            UnknownNameError: for an unknown parameter.
        """
        last, m = self.differentiated(parameters), self.mechanism
        state = {"q": (q, m.nv), "v": (v, m.nv), "s": (s, len(m.states))}
        bar = np.vstack([*(_columns(name, x, n, 1) for name, (x, n) in state.items()), np.zeros((1, 1))])[:, 0]
        y, p = last.adjoint(bar)
        by_dt = None
        if dt:
            zeros = np.zeros((len(bar), 1)), np.zeros((len(p), 1))
            by_dt = float(bar @ last.tangents(*zeros, np.ones(1))[-1, :, 0])
        gradient, column = [float(x) for x in p], last.parameters.column
        return Adjoint(
            y[: m.nv], y[m.nv : 2 * m.nv], y[2 * m.nv : -1],
            {name: gradient[column("input", name)] for name in self.inputs.user_inputs},
            {name: gradient[column("input of first order", name)] for name in last.parameters.linear},
            {name: gradient[column("parameter", name)] for name in parameters}, by_dt,
        )  # fmt: skip

    def differentiated(self, parameters: Sequence[str] = ()) -> AdvanceSensitivity:
        """Return the last advance with its derivatives at all nodes, in columns of inputs and of these parameters.

        Raises:
            InputError: see `tangent`.
            UnknownNameError: for an unknown parameter.
        """
        last, run = self._last, self._run
        require(parameters, Iterable, "parameters are given by dotted names")
        if last is None:
            raise InputError("no advance to differentiate: the simulator has not advanced since its start or restore")
        if self.status == "event":
            raise InputError("the last advance ended in an event, whose time varies: it has no derivative at fixed dt")
        if self._bound is None or self._bound.names != tuple(parameters):
            m = self.mechanism
            mode = self._run.system.mode  # type: ignore[attr-defined]
            q, v, s, _ = np.split(run.ys[last.node], np.cumsum([m.nq, m.nv, len(m.states)]))
            self._bound = AdvanceParameters(self.inputs, parameters, (last.t, q, v, s), mode)
            self._differentiated = None
        self._bound.span.start, self._bound.span.length = last.t, last.dt
        if self._differentiated is None:
            self._differentiated = AdvanceSensitivity(run, last, self._bound)
        return self._differentiated


def _require_tables(given: Mapping[str, object]) -> None:
    for kind, table in given.items():
        require(table, Mapping, f"variations of each {kind} are given by name, {{name: number}}")


def _columns(name: str, x: object, n: int, m: int) -> Array:
    """Return variations of n numbers in m directions, (n, m), from (n,), the same for each, or (n, m); None is 0.

    Raises:
        InputError: for wrong shapes, or numbers that are not finite.
    """
    try:
        found = np.zeros((n, 1)) if x is None else np.asarray(x, float)
        found = found[:, None] if found.ndim == 1 else found
    except (TypeError, ValueError):
        found = np.empty((0, 0))
    if found.shape not in ((n, 1), (n, m)) or not np.isfinite(found).all():
        raise InputError(f"{name} must be {n} finite numbers{f', or {n} rows of {m}' * (m > 1)}, got {x!r:.60}")
    return np.broadcast_to(found, (n, m))
