"""Result of a fit: values, their uncertainties, and residuals."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...data_types import JsonObject
from ...file_io import write_page
from ...system import Array
from ...tabular import Columns, Tabular
from ...tolerances import SIGNIFICANCE_LEVEL, SOLUTION_ROUNDING, THREE_DIGITS
from ...units import displayed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__: list[str] = []

MAX_CORRELATION = 0.999  # correlation above which only a combination of two parameters is identifiable


class Attempt(NamedTuple):
    """A search of a fit: its start, its final values (empty if it failed), and its message."""

    start: dict[str, float]
    values: dict[str, float]
    chi2: float
    converged: bool
    message: str


@dataclass(frozen=True)
class Fit(Tabular):
    """Parameters identified from measurements.

    Attributes:
        model: title of the model.
        values: the parameters at the least sum of squares.
        deviations: their standard deviations; inf if unidentifiable.
        covariance: covariance matrix, (k, k): (J^T J)^-1 of residuals in noise levels, or with the variances of the
            signals if these are unknown; inf and nan for unidentifiable parameters.
        correlations: correlation coefficients, (k, k); nan for unidentifiable parameters.
        chi2: sum of squares of residuals in noise levels.
        dof: number of measured values minus number of parameters.
        probability: probability of a larger chi2 for pure noise; nan without known noise levels.
        unidentifiable: groups of unidentifiable parameters, singly or in a combination.
        at_bounds: parameters at a bound.
        residuals: (computed - measured) / sigma of each run by signal, (n,) each.
        computed: computed signals of each run by name, (n,) each.
        measured: measured signals of each run by name, (n,) each.
        times: times of the samples of each run in s, (n,) each.
        names: names of the runs.
        runs: number of simulated runs.
        gradients: number of runs with derivatives.
        converged: whether the search converged.
        message: termination message.
        searches: the searches, one for each start.
        units: units of the signals.
        rejected: reasons why trial points were rejected: their runs failed or had no derivative.
        parameter_units: units of the parameters; "" if unknown.
        noise_known: whether noise levels were given; if not, all signals have the weight 1 in SI.
    """

    model: str
    values: dict[str, float]
    deviations: dict[str, float]
    covariance: Array
    correlations: Array
    chi2: float
    dof: int
    probability: float
    unidentifiable: list[tuple[str, ...]]
    at_bounds: list[str]
    residuals: list[dict[str, Array]] = field(repr=False)
    computed: list[dict[str, Array]] = field(repr=False)
    measured: list[dict[str, Array]] = field(repr=False)
    times: list[Array] = field(repr=False)
    names: list[str] = field(repr=False)
    runs: int = 0
    gradients: int = 0
    converged: bool = True
    message: str = ""
    searches: list[Attempt] = field(default_factory=list, repr=False)
    units: dict[str, str] = field(default_factory=dict, repr=False)
    rejected: tuple[str, ...] = field(default=(), repr=False)
    parameter_units: dict[str, str] = field(default_factory=dict, repr=False)
    noise_known: bool = True

    @property
    def reduced_chi2(self) -> float:
        """Chi-squared over its degrees of freedom; nan without any."""
        return self.chi2 / self.dof if self.dof > 0 else np.nan

    @property
    def agreeing(self) -> int:
        """Number of searches that converged to this minimum."""
        return sum(s.chi2 <= self.chi2 * (1 + THREE_DIGITS) + SOLUTION_ROUNDING for s in self.searches)

    @property
    def refuted(self) -> bool:
        """Whether the residuals are not noise: a local minimum, or an inadequate model."""
        return bool(self.probability < SIGNIFICANCE_LEVEL)

    @property
    def success(self) -> bool:
        """Whether the search converged, residuals may be noise, and all parameters are identifiable."""
        return self.converged and not self.refuted and not self.unidentifiable

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        scalars = ("model", "values", "deviations", "chi2", "dof", "probability", "at_bounds", "runs", "gradients",
                 "converged", "message", "rejected")  # fmt: skip
        return {
            **{key: getattr(self, key) for key in scalars},
            "refuted": self.refuted,
            "unidentifiable": [list(group) for group in self.unidentifiable],
            "units": self.units,
            "parameter_units": self.parameter_units,
            "covariance": self.covariance.tolist(),
            "correlations": self.correlations.tolist(),
            "searches": [s._asdict() for s in self.searches],
            "data": [
                {"name": name, "t": t.tolist()}
                | {key: {x: a.tolist() for x, a in series.items()} for key, series in table.items()}
                for name, t, table in zip(self.names, self.times, self._series(), strict=True)
            ],
        }

    def _series(self) -> list[dict[str, dict[str, Array]]]:
        both = zip(self.measured, self.computed, self.residuals, strict=True)
        return [{"measured": m, "computed": c, "residuals": r} for m, c, r in both]

    def save(self, path: str | Path) -> None:
        """Write a page as .html: figure, values, correlations, and warnings; or as `Tabular.save`.

        Raises:
            InputError: for another suffix, or a path that cannot be written.
        """
        if Path(path).suffix != ".html":
            super().save(path)
            return
        from .page import page

        write_page(path, lambda: page(self), "a fit")

    def to_columns(self) -> Columns:
        """Return names, values and standard deviations of the parameters, in the units in which results are shown."""
        values, deviations, units = zip(*(self.displayed(name) for name in self.values), strict=True)
        columns = {"parameter": list(self.values), "value": list(values), "deviation": list(deviations)}
        return Columns({**columns, "unit": list(units)})

    def cells(self) -> list[list[str]]:
        """Return values and standard deviations."""
        shown = {name: self.displayed(name) for name in self.values}
        return [["parameter", "value", "deviation", "unit"],
                *([name, f"{x:.8g}", f"{d:.2g}", unit] for name, (x, d, unit) in shown.items())]  # fmt: skip

    def displayed(self, name: str, value: float | None = None) -> tuple[float, float, str]:
        """Return value and deviation of a parameter in display units, and the unit; ``value`` replaces its value."""
        si_unit = self.parameter_units.get(name, "")
        x, unit = displayed(self.values[name] if value is None else value, si_unit)
        return x, displayed(self.deviations[name], si_unit)[0], unit

    def remarks(self) -> list[str]:
        """Return the quality of the fit, and unidentifiable parameters."""
        return str(self).splitlines()[1 + len(self.values) :]

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw measured and computed signals, and residuals."""
        from .. import figures
        from .figure import compared

        return figures.save_if_path(compared(self), path)

    def __str__(self) -> str:
        lines = [f"fit of {self.model}: {self.runs} runs, {self.gradients} with derivatives"]
        for name in self.values:
            mark = " (at its bound)" if name in self.at_bounds else ""
            value, deviation, unit = self.displayed(name)
            lines.append(f"  {name:36s} {value:14.8g} +- {deviation:.2g} {unit}".rstrip() + mark)
        ratio = f" = {self.reduced_chi2:.3g}" if self.dof > 0 else ""
        lines.append(f"  chi^2 / degrees of freedom = {self.chi2:.4g} / {self.dof}{ratio}")
        names = list(self.values)
        pairs = [(abs(self.correlations[i, j]), i, j) for i in range(len(names)) for j in range(i)]
        for size, i, j in sorted(pairs, reverse=True)[:3]:
            if np.isfinite(size) and size > 0.5:
                lines.append(f"  correlation of {names[j]} and {names[i]}: {self.correlations[i, j]:+.3f}")
        if len(self.searches) > 1:
            lines.append(f"  {self.agreeing} of {len(self.searches)} searches ended at this minimum")
        return "\n".join([*lines, *(f"  {text}" for text in self.warnings)])

    @property
    def warnings(self) -> list[str]:
        """Warnings about the values, in words."""
        lines = []
        for group in self.unidentifiable:
            problem = "the data do not determine" if len(group) == 1 else "the data determine only a combination of"
            lines.append(f"{problem} {', '.join(group)}")
        if self.refuted:
            lines.append("residuals are not noise: a false minimum, too low noise levels, or a wrong model")
        if not self.noise_known and len(units := {*self.units.values()}) > 1:
            named = " and ".join(sorted(units))
            lines.append(f"signals in {named} have equal weights, on which the values depend: give sigma of each")
        if not self.converged:
            lines.append(f"the search did not converge: {self.message}")
        if self.rejected:
            lines.append(f"{len(self.rejected)} trials were rejected, the last: {self.rejected[-1]}")
        return lines
