"""Drift of a run: position and velocity residuals over all rows, and the energy balance."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data_types import JsonObject
from ...errors import require
from ...mechanism.tree.coordinate_units import quantity_units
from ...solution.columns import Residuals, energy_balance, energy_error, require_times, residuals
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from ...textbook.hessenberg import Hessenberg
from ...units import displayed, quantity
from ..method_variant import run_labels
from .impact_summary import ImpactSummary, impact_summary
from .long_time import momentum_changes, reject_textbook, reversal_error
from .trend import linear_trend

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["drift"]


@dataclass(frozen=True)
class History:
    """Drift over time.

    Attributes:
        title: title of the mechanism.
        method: a `mbdae.studies.method_variant.Variant` as text.
        label: method and tolerance or step.
        t: times in s, (n,).
        g: max |g| over rows (m, rad), (n,).
        Gv: max |G v| over rows (m/s, rad/s), (n,).
        energy: |E - E_0 - W| over the energy scale of `Drift`, (n,); None for a textbook problem.
        unit: unit of g, a list if rows have several, ``"m, rad"``; "" for a textbook problem.
        rate_unit: unit of Gv.
    """

    title: str
    method: str
    label: str
    t: np.ndarray
    g: np.ndarray
    Gv: np.ndarray
    energy: np.ndarray | None
    unit: str = ""
    rate_unit: str = ""


@dataclass(frozen=True)
class Drift(Tabular):
    """Result of `drift`. For a textbook problem, which has no energy, the energy fields are None.

    Attributes:
        title: title of the mechanism.
        method: method of the run, a `mbdae.studies.method_variant.Variant` as text.
        label: method and tolerance or step.
        t_end: last time in s.
        g_max: max |g| over rows and times (m, or rad for directions).
        g_end: max |g| over rows at the end.
        g_closure: name of the closure with the largest violation.
        g_rows: number of rows with a position level, and of all rows.
        Gv_max: max |G v| over rows and times (m/s, rad/s); of a textbook problem max |g_t + g_y f|.
        Gv_end: max |G v| at the end.
        energy_error: max |E - E_0 - W| in J; W is the work of non-conservative forces, integrated with the motion.
        energy_scale: max(|W|, kinetic energy, range of the potential energy) over all steps in J; 0 of a mechanism at
            rest, whose relative error is 0.
        work_end: W at the end in J.
        energy_trend: trend of E - E_0 - W in J/s, see `mbdae.studies.drift.trend.linear_trend`; None for a run of
            fewer than 100 nodes.
        energy_trend_error: its standard error in J/s.
        momenta: the relative change of each conserved momentum by name, see
            `mbdae.studies.drift.long_time.momentum_changes`; None unless requested.
        reversal: differences of q (m, rad) and v (m/s, rad/s) at the start after a run back from the end; None unless
            requested, or if that run ended early.
        history: residuals over time.
        impacts: the impacts of the run, whose loss is in W; None without impacts.
        units: units of ``g_max``, ``g_end``, ``Gv_max`` and ``Gv_end``: those of the rows with the largest residuals.
    """

    title: str
    method: str
    label: str
    t_end: float
    g_max: float
    g_end: float
    g_closure: str
    g_rows: tuple[int, int]
    Gv_max: float
    Gv_end: float
    energy_error: float | None
    energy_scale: float | None
    work_end: float | None
    energy_trend: float | None
    energy_trend_error: float | None
    history: History = field(repr=False, compare=False)
    units: dict[str, str] = field(default_factory=dict, kw_only=True)
    momenta: dict[str, float] | None = None
    reversal: tuple[float, float] | None = None
    impacts: ImpactSummary | None = None

    @property
    def energy_relative(self) -> float | None:
        """Relative error of the energy balance."""
        if self.energy_error is None or self.energy_scale is None:
            return None
        return self.energy_error / self.energy_scale if self.energy_scale else 0.0

    @property
    def largest(self) -> float:
        """The largest of |g|, |G v| and the relative error of the energy balance."""
        return float(np.max([self.g_max, self.Gv_max, *([] if (e := self.energy_relative) is None else [e])]))

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "history"}
        impacts = None if self.impacts is None else self.impacts._asdict()
        return {**values, "impacts": impacts, "energy_relative": self.energy_relative}

    def to_columns(self) -> Columns:
        """Return largest |g| and |G v|, and the relative error of the energy balance, over time."""
        h = self.history
        columns = {"t": h.t, "g": h.g, "Gv": h.Gv} | ({} if h.energy is None else {"energy": h.energy})
        return Columns(columns, {"t": "s", "g": h.unit, "Gv": h.rate_unit, "energy": "1"}, "t")

    def cells(self) -> list[list[str]]:
        """Return largest and last residuals, and the energy balance."""
        rows = [
            ["", "max", "at the end"],
            ["|g|", self.formatted("g_max"), self.formatted("g_end")],
            [self._velocity_label, self.formatted("Gv_max"), self.formatted("Gv_end")],
        ]
        if self.energy_error is None:
            return rows
        return [
            *rows,
            ["energy balance", quantity(self.energy_error, "J", ".2e"), "-"],
            ["energy balance, relative", f"{self.energy_relative:.2e}", "-"],
        ]

    def formatted(self, name: str) -> str:
        """Return a residual, ``"g_max"``, as text with its unit."""
        return quantity(getattr(self, name), self.units.get(name, ""), ".2e")

    @property
    def _velocity_label(self) -> str:
        return "|g_t + g_y f|" if self.energy_error is None else "|G v|"

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw the drift over time; saved if a path is given.

        Raises:
            InputError: for a format other than .png, .svg, .pdf or .pgf, or an unwritable path.
        """
        from .. import figures
        from .figure import drifts

        return figures.save_if_path(drifts([self.history]), path)

    def __str__(self) -> str:
        worst, (positional, rows) = f" ({self.g_closure})" if self.g_closure else "", self.g_rows
        note = (
            f"; over {positional} of {rows} rows, {rows - positional} have no position level"
            if positional < rows
            else ""
        )
        width = len(self._velocity_label)
        lines = [
            f"drift of {self.title}, {self.label}, t = {quantity(self.t_end, 's', 'g')}",
            f"  {'|g|':{width}}  max {self.formatted('g_max')}{worst}, at the end {self.formatted('g_end')}{note}",
            f"  {self._velocity_label}  max {self.formatted('Gv_max')}, at the end {self.formatted('Gv_end')}",
        ]
        if self.energy_error is not None:
            relative = f"{self.energy_relative:.2e} (work {quantity(self.work_end or 0.0, 'J', '.4g')})"
            lines.append(f"  energy balance {quantity(self.energy_error, 'J', '.2e')}, relative {relative}")
        if self.energy_trend is not None:
            spread = quantity(self.energy_trend_error or 0.0, "J/s", ".1e")
            lines.append(f"  energy trend {displayed(self.energy_trend, 'J/s')[0]:.1e} +- {spread}")
        if self.momenta is not None:
            changes = ", ".join(f"{name} {x:.1e}" for name, x in self.momenta.items())
            lines.append(f"  conserved momenta, relative change: {changes or 'none'}")
            q, v = self.reversal or (np.nan, np.nan)
            back = f"|dq| {q:.1e}, |dv| {v:.1e}" if self.reversal else "ended early"
            lines.append(f"  run back to the start: {back}")
        lines += [f"  {self.impacts}"] if self.impacts else []
        return "\n".join(lines)


def _textbook_drift(sol: Solution, problem: Hessenberg) -> Drift:
    system, (method, label) = problem.system(), run_labels(sol)
    points = list(zip(sol.t.tolist(), sol.y, sol.z_own, strict=True))
    g = np.array([np.abs(system.g(t, y)).max(initial=0.0) for t, y, _ in points])
    hidden = np.array([np.abs(system.hidden(t, y, z)).max(initial=0.0) for t, y, z in points])
    rows = len(problem.z0)
    return Drift(
        problem.title, method, label, float(sol.t[-1]), float(g.max()), float(g[-1]), "", (rows, rows),
        float(hidden.max()), float(hidden[-1]), None, None, None, None, None,
        History(problem.title, method, label, sol.t, g, hidden, None),
    )  # fmt: skip


def drift(sol: Solution, *, long_time: bool = False) -> Drift:
    """Measure the drift of a solution at its times.

    Position level: g(t, q) over all rows, monitored and not enforced. Velocity level: G v + g_t. Energy: kinetic and
    potential energy minus their start value and the integrated work, E(t) - E_0 - W(t). For a textbook problem g,
    which methods enforce, and the residual of the hidden constraint with the method's z, g_t + g_y f(t, y, z); it has
    no energy.

    Args:
        sol: the solution, of a mechanism or a textbook problem.
        long_time: measure the change of conserved momenta, and the error of a run back to the start, which is rounding
            for a symmetric method.

    Returns:
        Largest and last residuals, and their history.

    Raises:
        InputError: for a solution without times, or another argument; for a textbook problem with ``long_time``.
    """
    require(sol, Solution, "drift takes a Solution (see mbdae.solve)")
    require_times(sol)
    if isinstance(sol.problem, Hessenberg):
        if long_time:
            reject_textbook(sol.problem.title)
        return _textbook_drift(sol, sol.problem)
    mech, r = sol.mechanism, residuals(sol)
    abs_g, abs_Gv = np.abs(r.g), np.abs(r.Gv)
    error, scale, relative = _energy_balance(sol, r)
    trend, trend_error = linear_trend(sol.t, error) or (None, None)
    error = np.abs(error)
    method, label = run_labels(sol)
    history = History(
        mech.title, method, label, sol.t, abs_g.max(axis=1, initial=0.0), abs_Gv.max(axis=1, initial=0.0),
        np.abs(relative),
        quantity_units(mech)["g"], quantity_units(mech)["Gv"],
    )  # fmt: skip
    where = mech.row_names[_largest_row(abs_g)] if mech.positional.any() else ""
    units = {
        f"{name}_{suffix}": f"{mech.row_units[_largest_row(values)]}{per}"
        for name, x, per in (("g", abs_g, ""), ("Gv", abs_Gv, "/s"))
        for suffix, values in (("max", x), ("end", x[-1:]))
        if mech.ng
    }
    return Drift(
        title=mech.title,
        method=method,
        label=label,
        t_end=float(sol.t[-1]),
        g_max=float(abs_g.max(initial=0)),
        g_end=float(abs_g[-1].max(initial=0)),
        g_closure=where,
        g_rows=(int(mech.positional.sum()), mech.ng),
        Gv_max=float(abs_Gv.max(initial=0)),
        Gv_end=float(abs_Gv[-1].max(initial=0)),
        energy_error=float(error.max()),
        energy_scale=scale,
        work_end=float(sol.work[-1] - sol.work[0]),
        energy_trend=trend,
        energy_trend_error=trend_error,
        history=history,
        momenta=momentum_changes(sol) if long_time else None,
        reversal=reversal_error(sol) if long_time else None,
        impacts=impact_summary(sol),
        units=units,
    )


def _energy_balance(sol: Solution, r: Residuals) -> tuple[Array, float, Array]:
    """Return E - E_0 - W at the times of a solution in J, (n,), the reference energy in J, and their ratio.

    The reference energy is that of all nodes: at the times of ``t_eval`` the mechanism may be at rest.
    """
    t, y, _ = sol.nodes
    with np.errstate(over="ignore", invalid="ignore"):  # overflow of a diverging run
        kinetic, potential = sol.system.residuals(t, y)[2].T if sol.steps else (r.kinetic, r.potential)
        error, _ = energy_error(r.kinetic, r.potential, sol.work)
        _, scale = energy_balance(sol, kinetic, potential, y[:, -1])
        return error, scale, error / scale if scale else np.zeros(len(error))


def _largest_row(values: np.ndarray) -> int:
    """Return the row with the largest of values (n, ng)."""
    return int(np.unravel_index(values.argmax(), values.shape)[1])
