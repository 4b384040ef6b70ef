"""Check that steps of a run resolve its curves and tables: in a dwell, steps grow until one skips a lobe."""

from collections.abc import Iterator, Sequence
from weakref import WeakKeyDictionary

import numpy as np

from ... import hermite
from ...errors import InputError
from ...mechanism.closures.closure import Closure
from ...mechanism.closures.motion_laws import LawTable
from ...mechanism.closures.profiles import PointProfile
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.mechanism import Mechanism
from ...mechanism.time_functions.piecewise_polynomial import PiecewisePolynomial
from ...mechanism.time_functions.time_function_base import PiecewiseFunction
from ...solution.solution import Solution
from ...tolerances import SMALLEST_PART

MAX_CHECKED = 64  # number of longest steps that are checked
SAMPLES = 24  # times within a step at which closures are computed
MAX_DEVIATION = 0.1  # fraction of the range of a table: largest deviation from a cubic in a step
MAX_VIOLATION = 0.01  # rad or characteristic lengths, within a step
DENSE_OUTPUT_FACTOR = 1e4  # multiple of rtol: larger violations in a step are not errors of dense output


def skipped_shape(sol: Solution, system: Index2System) -> str:
    """Return which step skipped the shape of a curve of closures, or of a table over time; empty if none.

    Within a step, positions from the dense output satisfy a closure that its stages resolved, and a table is close to
    the cubic through both ends of the step.
    """
    tables, closures = list(tables_over_time(system)), closures_with_curves(sol.mechanism)
    if not (tables or closures):
        return ""
    t = sol.nodes[0]
    h = np.abs(np.diff(t))
    longest = np.sort(np.argsort(-h, kind="stable")[:MAX_CHECKED])
    for i in longest[h[longest] > SMALLEST_PART * h.sum()]:  # shorter ones are impacts and jumps
        ends = float(t[i]), float(t[i + 1])
        names = [name for name, table in tables if _is_skipped(table, *ends)]
        if names or (names := _skipped(closures, sol, system, int(i))):
            step = f"the step of {abs(ends[1] - ends[0]):.2g} s from t = {ends[0]:.6g} s skipped points of {names[0]!r}"
            return f"{step}: take a smaller max_step"
    return ""


def tables_over_time(system: Index2System) -> Iterator[tuple[str, PiecewisePolynomial]]:
    """Yield the tables over time of forces and drivers by name; of other functions, all points are ends of steps."""
    laws = ((law.name, u) for law, _ in system.laws.bound for u in law.time_functions)
    drivers = ((driver.name, driver.path) for driver in system.mechanism.drivers)
    for name, function in (*laws, *drivers):
        table = function.polynomials if isinstance(function, PiecewiseFunction) else function
        if isinstance(table, PiecewisePolynomial) and len(table.breakpoints) > 1 + len(table.nonsmooth_times):
            yield name, table


def _is_skipped(table: PiecewisePolynomial, t0: float, t1: float) -> bool:
    """Return whether a table differs from the cubic through the ends of a step at a point in between."""
    try:
        knots = table.knots_between(t0, t1)
    except InputError:
        return True  # too many points to list
    if not knots:
        return False
    h, values = t1 - t0, [table.at(t) for t in table.breakpoints]
    at_ends = [(np.array([table.at(t0, k) * h**k]), np.array([table.at(t1, k) * h**k])) for k in (0, 1)]
    cubic = hermite.fit(at_ends, np.empty((0, 1)))[:, 0]
    error = max(abs(table.at(t) - float(hermite.powers((t - t0) / h, 3) @ cubic)) for t in knots)
    return error > MAX_DEVIATION * (max(values) - min(values))


def _skipped(closures: Sequence[Closure], sol: Solution, system: Index2System, i: int) -> list[str]:
    """Return the closures that are violated between the ends of the i-th step."""
    if not closures:
        return []
    mech, t = sol.mechanism, sol.nodes[0]
    limit = max(min(MAX_VIOLATION, DENSE_OUTPUT_FACTOR * sol.settings.get("rtol", 1.0)), 10 * system.largest_g)
    times = np.linspace(t[i], t[i + 1], SAMPLES + 2)[1:-1]
    g = system.residuals(times, np.array(list(sol.points(times))))[0] / mech.row_scales
    return [c.name for c in closures if not (np.abs(g[:, mech.rows_of(c.name)]) <= limit).all()]


def closures_with_curves(mech: Mechanism) -> list[Closure]:
    """Return the closures that are always active and have a curve through points."""
    if mech not in _WITH_CURVES:
        curves = [c for c in mech.closures if any(isinstance(x, LawTable | PointProfile) for x in vars(c).values())]
        switched = {row for s in mech.switches for row in s.rows} if curves else set()
        _WITH_CURVES[mech] = [c for c in curves if switched.isdisjoint(mech.rows_of(c.name))]
    return _WITH_CURVES[mech]


_WITH_CURVES: WeakKeyDictionary[Mechanism, list[Closure]] = WeakKeyDictionary()  # mechanisms are immutable
