"""Step across a singular configuration by polynomial extrapolation of previous states.

Where closures lose rank, a solve divides by a vanishing pivot: steps would become tiny, and rounding errors would
dominate the result. The motion along its branch is smooth there, so a polynomial of (v, s, w) through four states and
their rates is extrapolated, q follows by integration, and the end point is projected onto the closures.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...discovery import lazy_import
from ...errors import InputError, StepError
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.singularity import Singular, singular, singular_crossing
from ...system import Array
from ...tolerances import CLOSED, EVALUATION_ROUNDING, INTERPOLATION, ROUNDING, SEARCH_TOLERANCE

if TYPE_CHECKING:
    from ..run.run_state import RunState

solve_ivp = lazy_import("scipy.integrate", "solve_ivp")
minimize_scalar = lazy_import("scipy.optimize", "minimize_scalar")
OFFSETS = (2.0, 5.0, 9.0)  # times the predicted time to the singular configuration: times back to the earlier states
SEARCH_RANGE = 4.0  # times the predicted time: search range for a singular configuration
SAMPLES = 24  # number of samples in the search range
DEPTH = 0.05  # fraction of the current pivot ratio: smaller minima are singular configurations
OVERSHOOT = 1.3  # times the time to the singular configuration: smallest size of a crossing
MIN_REMAINING = 0.7  # times the time to the singular configuration: a run that ends earlier does not cross it
POSITION_ACCURACY = INTERPOLATION  # rad or characteristic lengths: accuracy of the position of a singular configuration


class SingularityCrossing(NamedTuple):
    """Crossing of a singular configuration.

    Attributes:
        t: end time of the crossing, or the end of the run if that is close to the singular configuration.
        y: point at t; after the singularity, on the closures.
        path: y as a function of the time since the start of the crossing, (dt) -> (n,).
        error: difference of the polynomials of degree 2 k - 1 and 2 k - 3 through k and k - 1 states, in the tangent.
        correction: displacement of the end point by the projection.
        singular: the singular configuration.
    """

    t: float
    y: Array
    path: "ContinuationPolynomial"
    error: Array
    correction: Array
    singular: Singular


class ContinuationPolynomial:
    """Extrapolation of the motion by the polynomial of u = (v, s, w) through the last state and earlier states.

    Args:
        system: a workspace.
        ts: times of the states, the last state first, (k,).
        y: the last point, (n,).
        us: (v, s, w) of all states, (k, m).
        rates: rates of us, (k, m).
        reach: the largest extrapolated time, signed.
    """

    def __init__(self, system: Index2System, ts: Array, y: Array, us: Array, rates: Array, reach: float) -> None:
        self.system, self.y, self.t, self.reach = system, y, ts[0], reach
        self.unit = abs(ts[-1] - ts[0]) or abs(reach)
        x, degree = (ts - ts[0]) / self.unit, 2 * len(ts) - 1
        powers = np.arange(degree + 1)
        values = x[:, None] ** powers
        derivatives = powers * x[:, None] ** np.maximum(powers - 1, 0)
        self.c = np.linalg.solve(np.vstack([values, derivatives]), np.vstack([us, self.unit * rates]))
        if not system.manifold.flat:
            zero, tolerances = np.zeros(system.nv), {"rtol": EVALUATION_ROUNDING, "atol": ROUNDING}
            self.tangent_path = solve_ivp(self._rate, (0.0, reach), zero, "DOP853", dense_output=True, **tolerances).sol

    def _rate(self, dt: float, x: Array) -> Array:
        return self.system.manifold.tangent(x, self.tail(dt)[: self.system.nv])

    def tail(self, dt: float) -> Array:
        """Return (v, s, w) after dt."""
        return (dt / self.unit) ** np.arange(len(self.c)) @ self.c

    def __call__(self, dt: float) -> Array:
        """Return y after dt."""
        s = self.system
        if s.manifold.flat:
            k = np.arange(1, len(self.c) + 1)
            x = (self.unit * (dt / self.unit) ** k / k) @ self.c[:, : s.nv]
        else:
            x = self.tangent_path(dt)
        return np.concatenate([s.manifold.integrate(self.y[: s.nq], x), self.tail(dt)])


def cross_singularity(
    system: Index2System, run: "RunState", time_ahead: float, first: int
) -> SingularityCrossing | None:
    """Return the crossing of a singular configuration about ``time_ahead`` seconds ahead; None if there is none.

    Args:
        system: a workspace with the rank and the rows in use of the run.
        run: the run, which provides nodes, rates, the end of the smooth interval, and the backward stepper.
        time_ahead: predicted seconds until the pivot ratio vanishes, positive.
        first: node after the last jump or crossing.

    Raises:
        StepError: if earlier states cannot be computed, or the end point cannot be projected.
    """
    ts, ys, rates = _earlier_states(run, time_ahead, first)
    if len(ts) < 2:
        return None
    us, rates = ys[:, system.nq :], rates[:, system.nv :]
    reach, y = run.sign * SEARCH_RANGE * time_ahead, run.ys[-1]
    path = ContinuationPolynomial(system, ts, y, us, rates, reach)
    ratio = system.pivot_ratio(run.t, y)

    def value(dt: float) -> float:
        return system.pivot_ratio(run.t + dt, path(dt))

    minimum = _lowest(value, np.linspace(0.0, reach, SAMPLES + 1))
    if minimum is None or not minimum[1] < DEPTH * ratio:
        return None
    dt = minimum[0]
    end = min(2 * abs(dt), run.time_to_interval_end())
    ends_near = end < OVERSHOOT * abs(dt)
    if ends_near and (end < MIN_REMAINING * abs(dt) or run.interval.restart is not None):
        return None
    lower_order = ContinuationPolynomial(system, ts[:-1], y, us[:-1], rates[:-1], reach)
    difference = system.difference(path(dt), lower_order(dt))[: system.nv] / system.mechanism.coordinate_scales
    if np.abs(difference).max() > POSITION_ACCURACY or not singular_crossing(
        system, run.t + dt, path(dt), DEPTH * ratio, CLOSED
    ):
        return None
    t = run.interval.end if end == run.time_to_interval_end() else run.t + run.sign * end
    y1 = path(run.sign * end)
    y_end = y1 if ends_near else system.project_state(t, y1, True)  # close to it, rounding dominates v
    error = system.difference(lower_order(run.sign * end), y1)
    configuration = singular(system, run.t + dt, path(dt), (run.t, y), DEPTH * ratio)
    if configuration is None:
        return None
    return SingularityCrossing(t, y_end, path, error, system.difference(y1, y_end), configuration)


def _earlier_states(run: "RunState", time_ahead: float, first: int) -> tuple[Array, Array, Array]:
    """Return times, points and rates of the last node and of states about `OFFSETS` times ``time_ahead`` before it.

    If backward steps are possible, the states are recomputed from the last node: nodes of the run contain the errors of
    its steps, which extrapolation magnifies a hundredfold. At the start of a smooth interval the states are fictitious:
    forces are continued backward in time across the impact or jump.
    """
    ages = np.abs(np.array(run.ts[first:]) - run.t)
    if run.backward_stepper and (run.backward_stepper.from_any_node or ages[0] < OFFSETS[-1] * time_ahead):
        offsets = np.array(OFFSETS) * (min(1.0, ages[0] / (OFFSETS[-1] * time_ahead)) or 1.0)
        with suppress(StepError, InputError):  # near singular configurations rounding may prevent accurate steps
            return run.backward_stepper(run, run.t - run.sign * time_ahead * offsets)
    selected = [len(ages) - 1]
    for offset in OFFSETS:
        earlier = ages[: selected[-1]]
        if not len(earlier):
            break
        selected.append(int(np.abs(earlier - offset * time_ahead).argmin()))
    nodes = [first + i for i in selected]
    points, rates = [run.ys[i] for i in nodes], [run.partial_solution().rate(i) for i in nodes]
    return np.array([run.ts[i] for i in nodes]), np.array(points), np.array(rates)


def _lowest(value: Callable[[float], float], dts: Array) -> tuple[float, float] | None:
    """Return the first local minimum of a function over samples, refined; None if the samples are monotonic."""
    values = [value(dt) for dt in dts]
    for k in range(1, len(dts) - 1):
        if values[k] <= values[k - 1] and values[k] <= values[k + 1]:
            lo, hi = sorted((dts[k - 1], dts[k + 1]))
            options = {"xatol": SEARCH_TOLERANCE * (hi - lo)}
            best = minimize_scalar(value, bounds=(lo, hi), method="bounded", options=options)
            return float(best.x), float(best.fun)
    return None
