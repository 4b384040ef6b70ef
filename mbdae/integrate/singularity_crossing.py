"""A step over a singular configuration, along polynomials through the states before it.

Where closures lose rank a solve divides by a pivot that vanishes: steps would creep towards it, and rounding would say
where they lead. But the motion on its own branch is smooth there. So the polynomial of (v, s, w) through four states
and their rates leads across, q by its integral, and the point behind is brought onto the closures.
"""

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from ..errors import StepError
from ..mechanism.formulations.index2 import Index2System
from ..mechanism.singularity import Singular, singular, singular_crossing
from ..system import Array

OFFSETS = (2.0, 5.0, 9.0)  # times the way to the singular configuration: where further states are taken from
SEARCH_RANGE = 4.0  # times the way: how far ahead a singular configuration is looked for
SAMPLES = 24  # points of the way
DEPTH = 0.05  # of the ratio of pivots here: what it must fall below to be a singular configuration
OVERSHOOT = 1.3  # times the way, at least: how far the end of a leap lies
AHEAD = 0.7  # times the way: where the end of a run is as near that a leap leads to it
KNOWN = 1e-5  # rad or m: how well the place of a singular configuration must be known
CLOSE = 1e-9  # of the size of G: residual of closures in a singular configuration; bars with a gap keep a larger one
ROOT_TOLERANCE = 1e-10  # of the way: how sharply the smallest ratio is located


class SingularityCrossing(NamedTuple):
    """A way over a singular configuration.

    Attributes:
        t: time behind it, or the end of the run in front of it or next to it.
        y: point there; behind it on the closures.
        path: y after a time from where the leap begins, (dt) -> (n,).
        error: difference of the polynomials of degree 2 k - 1 and 2 k - 3 through k states, in the tangent.
        move: what bringing the point onto the closures moved.
        passed: the singular configuration.
    """

    t: float
    y: Array
    path: "ContinuationPolynomial"
    error: Array
    move: Array
    passed: Singular


class ContinuationPolynomial:
    """The motion continued from a state by the polynomial of u = (v, s, w) through it and earlier ones.

    Args:
        system: a workspace.
        ts: times of the states, the last one first, (k,).
        y: the last state.
        us: the tails (v, s, w) of all of them, (k, m).
        rates: and their rates, (k, m).
        reach: the longest way, signed.
    """

    def __init__(self, system: Index2System, ts: Array, y: Array, us: Array, rates: Array, reach: float) -> None:
        self.system, self.y, self.t, self.reach = system, y, ts[0], reach
        self.unit = abs(ts[-1] - ts[0]) or abs(reach)
        x, degree = (ts - ts[0]) / self.unit, 2 * len(ts) - 1
        powers = np.arange(degree + 1)
        values = x[:, None] ** powers
        slopes = powers * x[:, None] ** np.maximum(powers - 1, 0)
        self.c = np.linalg.solve(np.vstack([values, slopes]), np.vstack([us, self.unit * rates]))
        if not system.manifold.flat:
            zero, rtol = np.zeros(system.nv), 1e-13
            span = (0.0, reach)
            self.turn = solve_ivp(self._rate, span, zero, "DOP853", dense_output=True, rtol=rtol, atol=1e-15).sol

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
            x = self.turn(dt)
        return np.concatenate([s.manifold.integrate(self.y[: s.nq], x), self.tail(dt)])


def cross_singularity(system: Index2System, run: Any, way: float, first: int) -> SingularityCrossing | None:
    """Find the way over a singular configuration that lies about ``way`` seconds ahead; None where there is none.

    Args:
        system: a workspace with the run's rank and rows.
        run: its nodes and their rates, the end of its leg, and the way back from its last node.
        way: seconds until the ratio of pivots vanishes, positive.
        first: node behind the last jump or leap.

    Raises:
        StepError: if states before cannot be found, or the point behind not be brought onto the closures.
    """
    ts, ys, rates = _earlier_states(run, way, first)
    if len(ts) < 2:
        return None
    us, rates = ys[:, system.nq :], rates[:, system.nv :]
    reach, y = run.sign * SEARCH_RANGE * way, run.ys[-1]
    path = ContinuationPolynomial(system, ts, y, us, rates, reach)
    here = system.pivot_ratio(run.t, y)

    def value(dt: float) -> float:
        return system.pivot_ratio(run.t + dt, path(dt))

    found = _lowest(value, np.linspace(0.0, reach, SAMPLES + 1))
    if found is None or not found[1] < DEPTH * here:
        return None
    dt = found[0]
    end = min(2 * abs(dt), run.left())
    beside = end < OVERSHOOT * abs(dt)
    if beside and (end < AHEAD * abs(dt) or run.leg.restart is not None):
        return None
    lower = ContinuationPolynomial(system, ts[:-1], y, us[:-1], rates[:-1], reach)
    moved = float(np.abs(system.difference(path(dt), lower(dt))[: system.nv]).max())
    if moved > KNOWN or not singular_crossing(system, run.t + dt, path(dt), DEPTH * here, CLOSE):
        return None
    t = run.leg.end if end == run.left() else run.t + run.sign * end
    there = path(run.sign * end)
    closed = there if beside else system.restore(t, there, True)  # next to it rounding would turn v
    error = system.difference(lower(run.sign * end), there)
    passed = singular(system, run.t + dt, path(dt), (run.t, y), DEPTH * here)
    if passed is None:
        return None
    return SingularityCrossing(t, closed, path, error, system.difference(there, closed), passed)


def _earlier_states(run: Any, way: float, first: int) -> tuple[Array, Array, Array]:
    """Times, points and rates of the last node and of states about `OFFSETS` times the way before it.

    Where the run can step back they are found anew from the last node: those on the way to it have errors of the steps
    between, which a polynomial magnifies a hundredfold. Where a leg begins they are states that it would come from: its
    forces continue across the impact or the jump before.
    """
    back = np.abs(np.array(run.ts[first:]) - run.t)
    if run.back and (run.back.anywhere or back[0] < OFFSETS[-1] * way):
        offsets = np.array(OFFSETS) * (min(1.0, back[0] / (OFFSETS[-1] * way)) or 1.0)
        with suppress(StepError):  # near singular configurations rounding may forbid sharp steps
            return run.back(run.t - run.sign * way * offsets)
    chosen = [len(back) - 1]
    for offset in OFFSETS:
        earlier = back[: chosen[-1]]
        if not len(earlier):
            break
        chosen.append(int(np.abs(earlier - offset * way).argmin()))
    nodes = [first + i for i in chosen]
    points, rates = [run.ys[i] for i in nodes], [run.record().rate(i) for i in nodes]
    return np.array([run.ts[i] for i in nodes]), np.array(points), np.array(rates)


def _lowest(value: Any, dts: Array) -> tuple[float, float] | None:
    """The first local minimum of a function along its samples, sharpened; None where it only falls or rises."""
    values = [value(dt) for dt in dts]
    for k in range(1, len(dts) - 1):
        if values[k] <= values[k - 1] and values[k] <= values[k + 1]:
            lo, hi = sorted((dts[k - 1], dts[k + 1]))
            options = {"xatol": ROOT_TOLERANCE * (hi - lo)}
            best = minimize_scalar(value, bounds=(lo, hi), method="bounded", options=options)
            return float(best.x), float(best.fun)
    return None
