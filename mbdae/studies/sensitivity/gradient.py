"""The gradient of a cost of a run, by the adjoint: the steps backwards, for any number of parameters at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import require
from ...integrate.trace import Trace
from ...solution.solution import Solution
from .cost import Cost, Signals, evaluated
from .ending import ending
from .numbers import Model, Names, bound
from .sensitivity import begun, places, start_columns
from .signal_slopes import SignalSlopes

__all__ = ["gradient"]


@dataclass(frozen=True)
class Gradient:
    """A cost of a run and its gradient.

    Attributes:
        value: the cost.
        gradient: its derivative with respect to each parameter, and to (q, v, s) of the start where asked for.
    """

    value: float
    gradient: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
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
    event: Callable[..., float] | None = None,
) -> Gradient:
    """Differentiate a cost of a run: one pass back through its steps, whatever the number of parameters.

    The adjoint of `mbdae.sensitivity`, of which the arguments are: <w, J u> = <J^T w, u> to rounding. Beside the run
    itself it keeps what the method carries from step to step, nv + ns + 1 numbers for each; stages are computed again.

    Args:
        sol: the run.
        cost: signals -> (value, {signal: derivative (n,)}), with the signals of `mbdae.Solution.signals` by name at the
            times of the run; or `mbdae.Squares`.
        parameters: names, or name = value.
        start: differentiate with respect to the start, too.
        model: what makes the mechanism with other numbers.
        event: the function of the terminal event in which the run ended.

    Raises:
        InputError: for a run of another kind, a parameter or a signal without a derivative, a cost that is not finite.
        UnknownNameError: for names that lead nowhere.
    """
    require(sol, Solution, "gradient takes a Solution (see mbdae.solve)")
    values, numbers = bound(sol.mechanism, parameters, model, float(sol.nodes[0][0]))
    trace = Trace(sol, numbers)
    end, at = ending(trace, event), places(sol)
    between = np.flatnonzero(sol.t != trace.ts[at])
    points = sol.y.copy() if len(between) else sol.y
    for k in between:
        points[k] = trace.short(int(at[k]), float(sol.t[k] - trace.ts[at[k]]))[0]
    value, weights = evaluated(cost, Signals(replace(sol, y=points)), len(sol.t))
    signals = SignalSlopes(trace, list(weights))
    w = np.array(list(weights.values())).reshape(len(weights), len(sol.t))

    y, carry = np.zeros((trace.slopes.ny, 1)), np.zeros((trace.n_carry, 1))
    p = np.zeros((len(values), 1))
    for i in range(len(trace.ts) - 1, -1, -1):
        late = 0.0
        for m in range(*(int(x) for x in np.searchsorted(at, (i, i + 1)))):
            if not w[:, m].any():
                continue
            row = w[:, m] @ signals.rows(i, float(sol.t[m]), points[m])
            own, c = row[: len(y), None], np.zeros_like(carry)
            p += row[len(y) : -1, None]
            if sol.t[m] == trace.ts[i]:
                late += float(row[-1])
            else:
                for part in reversed(trace.short(i, float(sol.t[m] - trace.ts[i]))[1]):
                    own, c, by_p = part.reverse(own, c)
                    p += by_p
            y, carry = y + own, carry + c
        if i == 0:
            break
        last = end if i + 1 == len(trace.ts) else None
        if last:
            y = last.held(y, carry, len(p), late)
        for part in reversed(last.parts if last else list(trace.parts(i - 1))):
            y, carry, by_p = part.reverse(y, carry)
            p += by_p
    for part in reversed(list(trace.start())):
        y, carry, by_p = part.reverse(y, carry)
        p += by_p
    both = begun(trace, np.eye(len(values), len(values) + (len(y) - 1) * start), start).T @ y
    total = both[:, 0] + np.concatenate([p[:, 0], np.zeros(len(both) - len(p))])
    names = [*values, *(start_columns(trace) if start else ())]
    return Gradient(value, dict(zip(names, total.tolist(), strict=True)))
