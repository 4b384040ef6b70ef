"""Extrema, means and integrals of signals over a run, from the solution between its steps.

Signals are smooth within a step. They are sampled at Chebyshev-Lobatto points theta_k = (1 - cos(pi k/n))/2 of
the dense output, n = 4, 8, 16, 32 until the last coefficients of the Chebyshev series are small (Trefethen,
Approximation Theory and Approximation Practice, chapters 3 and 19). Values at both ends are limits from within the
step, so that a value just before an impact or a mode change is included. Extrema are at roots of the derivative of the
series, where the signal itself is evaluated; integrals are those of the series (Clenshaw-Curtis).
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..data_types import JsonObject
from ..system import Array
from ..tabular import Tabular, rounded_zero
from ..tolerances import COINCIDENT, EPS, INTERPOLATION, VISIBLE
from ..units import displayed, unit_name
from .columns import require_times
from .signals import find, signals, units

if TYPE_CHECKING:
    from .solution import Solution

DEGREES = (4, 8, 16, 32)
EXTREMUM_TOLERANCE = COINCIDENT  # fraction of the range of a signal: last terms of a series, for its extrema
INTEGRAL_TOLERANCE = INTERPOLATION  # for integrals, which are accurate to about 1e-10, as omitted terms oscillate
UNRESOLVED = 0.05  # fraction of the range: larger last terms that do not decay are rounding of a constant signal
RESIDUALS, DISCRETE = ("g", "Gv"), ("impulse", "mode")  # evaluated at the ends of steps only
FINE = 64  # points at which a series is sampled, to select the steps where its derivative's roots are computed


class Extremum(NamedTuple):
    """An extreme value and its time in s."""

    value: float
    t: float


class Integrals(NamedTuple):
    """The mean, the root mean square, and the integral over time (unit times s) of a signal."""

    mean: float
    rms: float
    integral: float


@dataclass(frozen=True)
class Statistics(Tabular):
    """Extrema, means and integrals of signals over a run.

    Attributes:
        minimum: smallest value of each signal.
        maximum: largest value of each signal.
        integrals: mean, root mean square and integral of each signal.
        units: unit of each signal.
    """

    minimum: dict[str, Extremum]
    maximum: dict[str, Extremum]
    integrals: dict[str, Integrals]
    units: dict[str, str]

    def peak(self, name: str) -> Extremum:
        """Return the value of largest magnitude of a signal, with its sign."""
        return max(self.minimum[name], self.maximum[name], key=lambda x: abs(x.value))

    def cells(self) -> list[list[str]]:
        """Return a row for each signal."""
        at = f"at {unit_name('s')}"
        headers = ["signal", "unit", "min", at, "max", at, "mean", "RMS", "integral"]
        return [headers, *(self._row(name) for name in self.minimum)]

    def _row(self, name: str) -> list[str]:
        """Return the cells of a signal; values and means within rounding of its peak are 0."""
        low, high, sums = self.minimum[name], self.maximum[name], self.integrals[name]
        scale = abs(self.peak(name).value)
        mean = rounded_zero(sums.mean, scale)
        values = [(rounded_zero(x.value, scale), x.t) for x in (low, high)]
        values_and_times = [*values[0], *values[1], mean, sums.rms, sums.integral if mean else 0.0]
        unit = self.units[name]
        units = [unit, "s", unit, "s", unit, unit, f"s {unit}"]
        cells = [f"{displayed(x, u)[0]:.7g}" for x, u in zip(values_and_times, units, strict=True)]
        return [name, unit_name(unit), *cells]

    def __str__(self) -> str:
        rows = self.cells()
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join("  ".join(x.ljust(w) for x, w in zip(row, widths, strict=True)).rstrip() for row in rows)

    def to_dict(self) -> JsonObject:
        """Return by signal: ``unit``, ``min``, ``t_min``, ``max``, ``t_max``, ``mean``, ``rms``, ``integral``."""
        return {
            name: {"unit": self.units[name], "min": low.value, "t_min": low.t, "max": self.maximum[name].value,
                   "t_max": self.maximum[name].t, **self.integrals[name]._asdict()}
            for name, low in self.minimum.items()
        }  # fmt: skip


def statistics(sol: "Solution", names: str | Collection[str]) -> Statistics:
    """Return extrema, means and integrals of signals, see `mbdae.solution.signals.find` for their names.

    Raises:
        UnknownNameError: for an unknown signal.
        InputError: for a solution of a textbook problem, or one without times.
    """
    requested, all_units = find(sol.mechanism, names), units(sol.mechanism)
    located = extrema(sol, requested)
    low, high = ({name: located[name][i] for name in requested} for i in (0, 1))
    return Statistics(low, high, integrals(sol, requested), {name: all_units[name] for name in requested})


def extrema(sol: "Solution", names: Collection[str]) -> dict[str, tuple[Extremum, Extremum]]:
    """Return the smallest and the largest value of signals over a run, located to rounding of the value.

    Residuals g and Gv, modes and impulses are evaluated at steps. Only steps that may contain an extremum are sampled:
    the end values of such a step differ from the extreme end value of all steps by no more than their local variation.
    """
    ends, t = _at_nodes(sol, names)
    smooth = [name for name in names if not _is_defined_at_steps(name)]
    run = _Steps(sol, smooth)
    ends |= {name: ends[name][run.node_at_step_end] for name in smooth}
    out = {name: (_extremum(x, t, np.argmin), _extremum(x, t, np.argmax)) for name, x in ends.items()}
    if not smooth or not len(run.steps):  # no step to sample
        return out
    values_at_nodes = np.array([ends[name] for name in smooth])
    span, steps = np.ptp(values_at_nodes, axis=1)[:, None], run.candidates(values_at_nodes)
    last = np.full((len(smooth), len(t)), np.inf)
    for degree in DEGREES:
        if not len(steps):
            break
        times, values, series = run.sample(steps, degree)
        tail, fine = np.abs(series[..., -2:]).max(axis=2), series @ _grid(degree)
        curves = zip(series, fine, strict=True)
        stationary = np.concatenate([_stationary_points(c, f, run.t[steps], run.h[steps]) for c, f in curves])
        for name, x, y in zip(smooth, values, run.at(stationary), strict=True):
            out[name] = _extended(out[name], np.append(x.ravel(), y), np.append(times.ravel(), stationary))
        low, high = np.array([[[out[name][i].value] for name in smooth] for i in (0, 1)])
        reaches = (fine.max(axis=2) + tail >= high) | (fine.min(axis=2) - tail <= low)
        constant = (tail > UNRESOLVED * span) & (tail > last[:, steps] / 2)
        last[:, steps] = tail
        steps = steps[((tail > EXTREMUM_TOLERANCE * span) & reaches & ~constant).any(axis=0)]
    return out


def integrals(sol: "Solution", names: Collection[str]) -> dict[str, Integrals]:
    """Return means, root mean squares and integrals of signals over a run, from its first time to its last.

    Residuals g and Gv are integrated from step to step; impulses are not functions of time, and give nan.
    """
    ends, t = _at_nodes(sol, names)
    out = {name: _sums(name, x, t) for name, x in ends.items() if _is_defined_at_steps(name)}
    return out | _integrals(sol, {name: x for name, x in ends.items() if name not in out}, t)


def _integrals(sol: "Solution", ends: dict[str, Array], t: Array) -> dict[str, Integrals]:
    """Return integrals of smooth signals with these values at the ends of steps."""
    if not ends:
        return {}
    length, h = float(t[-1] - t[0]), np.diff(t)
    if not length:
        return {name: Integrals(float(x[0]), float(abs(x[0])), 0.0) for name, x in ends.items()}
    total, squares = np.zeros(len(ends)), np.zeros(len(ends))
    for steps, series in resolved_series(sol, ends):
        degree = series.shape[2] - 1
        x, weights = np.polynomial.legendre.leggauss(degree + 1)
        inside = series @ np.polynomial.chebyshev.chebvander(x, degree).T
        total += (inside @ weights / 2) @ h[steps]
        squares += (inside**2 @ weights / 2) @ h[steps]
    return {
        name: Integrals(float(s / length), float(np.sqrt(max(s2 / length, 0.0))), float(s))
        for name, s, s2 in zip(ends, total, squares, strict=True)
    }


def resolved_series(sol: "Solution", names: Collection[str]) -> Iterator[tuple[Array, Array]]:
    """Yield steps (m,) of a run, each once, and series of smooth signals on them, (names, m, degree + 1)."""
    run, (ends, _) = _Steps(sol, names), _at_nodes(sol, names)
    span, steps = np.array([[np.ptp(ends[name])] for name in run.names]), run.steps
    for degree in DEGREES:
        if not len(steps):
            return
        _, _, series = run.sample(steps, degree)
        tail = np.abs(series[..., -2:]).max(axis=2)
        unresolved = (tail > INTEGRAL_TOLERANCE * span).any(axis=0) & (degree < DEGREES[-1])
        yield steps[~unresolved], series[:, ~unresolved]
        steps = steps[unresolved]


class _Steps:
    """Steps of a run, without jumps, and signals on them."""

    def __init__(self, sol: "Solution", names: Collection[str]) -> None:
        self.sol, self.names = sol, list(names)
        self.t = np.asarray(sol.nodes[0])
        self.h = np.diff(self.t)
        self.steps = np.flatnonzero(~sol.jumped())

    @property
    def node_at_step_end(self) -> Array:
        """For each node, the next node at an end of a step, (n,); others lie between a jump and a change of mode."""
        at_ends, nodes = np.union1d(self.steps, self.steps + 1), np.arange(len(self.t))
        return at_ends[np.minimum(np.searchsorted(at_ends, nodes), len(at_ends) - 1)] if len(at_ends) else nodes

    def candidates(self, values: Array) -> Array:
        """Return steps that may contain an extremum of a signal with these values at the nodes, (names, n)."""
        around = np.pad(values, ((0, 0), (1, 1)), mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(around, 4, axis=1)
        variation, pairs = np.ptp(windows, axis=2), windows[..., 1:3]
        high = pairs.max(axis=2) + variation >= values.max(axis=1, keepdims=True)
        low = pairs.min(axis=2) - variation <= values.min(axis=1, keepdims=True)
        possible = (high | low).any(axis=0)
        return self.steps[possible[self.steps]]

    def sample(self, steps: Array, degree: int) -> tuple[Array, Array, Array]:
        """Return times (m, n + 1) and signals (names, m, n + 1) at the points of steps, and their Chebyshev series."""
        theta = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
        times = self.t[steps, None] + self.h[steps, None] * theta
        times[:, -1] = np.nextafter(self.t[steps + 1], self.t[steps])  # just before the end, in the mode of the step
        values = self.at(times.ravel()).reshape(len(self.names), *times.shape)
        return times, values, values @ _to_series(degree)

    def at(self, times: Array) -> Array:
        """Return the signals at times, (names, k)."""
        if not len(times):
            return np.empty((len(self.names), 0))
        columns = signals(self.sol.resampled(times), self.names)
        return np.array([columns[name] for name in self.names])


def _at_nodes(sol: "Solution", names: Collection[str]) -> tuple[dict[str, Array], Array]:
    """Return signals at the ends of all steps, and their times."""
    require_times(sol)
    full = sol.at_nodes()
    return signals(full, names), np.asarray(full.t)


def _is_defined_at_steps(name: str) -> bool:
    return name in RESIDUALS or name.partition(".")[0] in DISCRETE


def _sums(name: str, x: Array, t: Array) -> Integrals:
    """Return integrals of signals that are defined at the ends of steps only."""
    length = float(t[-1] - t[0])
    if name.startswith("impulse") or not length:
        return Integrals(np.nan, np.nan, np.nan)
    total, squares = float(np.trapezoid(x, t)), float(np.trapezoid(x * x, t))
    return Integrals(total / length, float(np.sqrt(squares / length)), total)


def _extremum(x: Array, t: Array, which: Callable[[Array], Any]) -> Extremum:
    return Extremum(float(x[which(x)]), float(t[which(x)]))


def _extended(extrema: tuple[Extremum, Extremum], x: Array, t: Array) -> tuple[Extremum, Extremum]:
    """Return the extrema extended by samples x at times t; extrema that differ by rounding are kept."""
    low, high = _extremum(x, t, np.argmin), _extremum(x, t, np.argmax)
    rounding = EPS * max(abs(e.value) for e in (*extrema, low, high))
    return (
        low if low.value < extrema[0].value - rounding else extrema[0],
        high if high.value > extrema[1].value + rounding else extrema[1],
    )


@cache
def _to_series(degree: int) -> Array:
    """Return the matrix from values at the points of `_Steps.sample` to Chebyshev coefficients, as a right factor."""
    return np.linalg.inv(np.polynomial.chebyshev.chebvander(-np.cos(np.pi * np.arange(degree + 1) / degree), degree)).T


@cache
def _grid(degree: int) -> Array:
    """Return the matrix from coefficients to values at `FINE` points, as a right factor."""
    return np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, FINE), degree).T


def _stationary_points(series: Array, fine: Array, t: Array, h: Array) -> Array:
    """Return times of the largest and smallest extrema within the steps."""
    out = []
    for i in {int(fine.max(axis=1).argmax()), int(fine.min(axis=1).argmin())}:
        rate = np.trim_zeros(np.polynomial.chebyshev.chebder(series[i]), "b")
        roots = np.polynomial.chebyshev.chebroots(rate) if len(rate) > 1 else np.empty(0)
        inside = roots[(np.abs(roots.imag) < VISIBLE) & (np.abs(roots.real) < 1)].real
        out.append(t[i] + h[i] * (1 + inside) / 2)
    return np.concatenate(out)
