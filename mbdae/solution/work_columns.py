"""Work of each driver and force along a run: the integral of its power over time, within the accuracy of the run.

    W(t) = integral from the first node to t of power dt

from the exact antiderivatives of the Chebyshev series of the power on each step, see `mbdae.solution.statistics`. In
impacts a driver with the impulse P does the work P (u'- + u'+)/2; its speed u' jumps in the first one of an instant.
The sum over all forces, drivers and joints that stick equals the change of the kinetic energy and of the potential
energy of gravity, except for friction proportional to closure forces and for the work of contacts in impacts.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..mechanism.signals.effort_signals import brake_rows, driver_rates, driver_rows, effort_units
from ..system import Array

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .solution import Solution

POWER, WORK = "power.", "work."


class StepIntegrals(NamedTuple):
    """Integrals over time of k signals on the steps of a run.

    Attributes:
        t: times of the nodes, (n + 1,).
        starts: integrals from the first node to each node, (k, n + 1).
        series: Chebyshev series of the integrals within the steps, 0 at their starts, (k, n, degree + 1).
    """

    t: Array
    starts: Array
    series: Array

    def at(self, times: Array, steps: Array) -> Array:
        """Return the integrals at times (m,) within steps (m,), (k, m)."""
        h = self.t[steps + 1] - self.t[steps]
        x = np.divide(2 * (times - self.t[steps]), h, out=np.zeros(len(times)), where=h != 0) - 1
        polynomials = np.polynomial.chebyshev.chebvander(x, self.series.shape[2] - 1)
        return self.starts[:, steps] + np.einsum("kmi,mi->km", self.series[:, steps], polynomials)


def elements_with_power(mech: "Mechanism") -> list[str]:
    """Return the names of all forces, drivers and sticking joints that have a power."""
    forces = [name.removeprefix(POWER) for name in effort_units(mech) if name.startswith(POWER)]
    return [*forces, *(d.name for d in mech.drivers), *brake_rows(mech)]


def work_units(mech: "Mechanism") -> dict[str, str]:
    """Return names and units of the columns of `work_columns`."""
    return {f"{WORK}{name}": "J" for name in elements_with_power(mech)}


def work_columns(sol: "Solution") -> dict[str, Array]:
    """Return ``work.<name>`` of forces and drivers since the first node in J, (n,) each.

    NaN for a sequence of poses computed by a study, which has no steps in between.
    """
    names = elements_with_power(sol.mechanism)
    if not names:
        return {}
    if "dense_order" not in sol.settings:
        return {f"{WORK}{name}": np.full(len(sol.t), np.nan) for name in names}
    integrals, times = _integrated_works(sol, names), np.asarray(sol.t)
    last = len(integrals.t) - 1
    if last < 1:
        return {f"{WORK}{name}": np.zeros(len(times)) for name in names}
    nodes = sol.before(times) if sol.steps else np.arange(len(times))
    values = integrals.at(times, np.minimum(nodes, last - 1))
    values[:, nodes == last] = integrals.starts[:, -1:]  # after a last impact
    return {f"{WORK}{name}": x for name, x in zip(names, values, strict=True)}


def total_works(sol: "Solution") -> dict[str, float]:
    """Return the work of each force and driver over a whole run in J, by name."""
    names = elements_with_power(sol.mechanism)
    return dict(zip(names, _integrated_works(sol, names).starts[:, -1].tolist(), strict=True)) if names else {}


def _integrated_works(sol: "Solution", names: list[str]) -> StepIntegrals:
    """Return the works as integrals of powers, with those of impacts at the nodes after them."""
    if "work" not in sol.integrals:
        integrals = integrate_steps(sol, [f"{POWER}{name}" for name in names])
        sol.integrals["work"] = integrals._replace(starts=integrals.starts + _impact_works(sol, names))
    return sol.integrals["work"]


def _impact_works(sol: "Solution", names: list[str]) -> Array:
    """Return the work of drivers in the impacts before or at each node, (k, n + 1); other elements do none."""
    mech, t = sol.mechanism, np.asarray(sol.nodes[0], float)
    rows, out = driver_rows(mech), np.zeros((len(names), len(t)))
    columns, drivers = [names.index(name) for name in rows], list(rows.values())
    previous = -1
    for x in sol.impacts if drivers else ():
        after = int(sol.before(np.array([x.t]))[0])
        before = after - 1 if after != previous else after
        if after > 0:  # the work is counted from the first node on
            rates = driver_rates(mech, t[[before, after]])[:, drivers]
            out[columns, after] += np.array(x.rows)[drivers] * rates.mean(axis=0)
        previous = after
    return np.cumsum(out, axis=1)


def integrate_steps(sol: "Solution", names: list[str]) -> StepIntegrals:
    """Return the integrals of smooth signals over time on all steps of a run."""
    from .statistics import resolved_series

    t = np.asarray(sol.nodes[0], float)
    n = max(len(t) - 1, 0)
    series, terms = np.zeros((len(names), n, 1)), 1
    for steps, coefficients in resolved_series(sol, names):
        integral = 0.5 * np.diff(t)[steps][:, None] * np.polynomial.chebyshev.chebint(coefficients, lbnd=-1, axis=2)
        terms = max(terms, integral.shape[2])
        series = np.pad(series, ((0, 0), (0, 0), (0, terms - series.shape[2])))
        series[:, steps, : integral.shape[2]] = integral
    ends = series.sum(axis=2)  # at x = 1, where all polynomials are 1
    return StepIntegrals(t, np.concatenate([np.zeros((len(names), 1)), np.cumsum(ends, axis=1)], axis=1), series)
