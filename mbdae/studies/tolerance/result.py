"""Result of `mbdae.tolerance`: deviations of signals with their tables, texts and figure."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data_types import JsonObject
from ...mechanism import Mechanism
from ...mechanism.tree.coordinate_units import coordinate_units
from ...tabular import Columns, Tabular, align_columns, rounded_zero
from ...tolerances import NEGLIGIBLE
from ...units import displayed, quantity, unit_name
from ..kinematics.curve_derivatives import HOLDING
from .deviations import Contribution, Deviations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NONLINEAR = 0.05  # relative error of the linear worst case near a dead point above which it is reported
UNREACHABLE = 0.25  # relative error above which the quadratic equation for the pose has no solution
SHOWN = NEGLIGIBLE  # smallest listed contribution, as a fraction of the worst case; smaller ones are counted


def signal_units(mech: Mechanism, names: list[str], input_unit: str) -> dict[str, str]:
    """Return the units of signals of a curve; velocities are per unit of the input."""
    known = coordinate_units(mech)
    rates = {n: f"{known[f'q.{n[2:]}']}/{input_unit}" for n in known if n.startswith("v.") and f"q.{n[2:]}" in known}
    effort = {HOLDING: "N m" if input_unit == "rad" else "N"}
    return {name: (known | rates | effort).get(name, "m") for name in names}


class Tolerance(Deviations, Tabular):
    """Deviations of m signals along a curve of n poses, at fixed inputs; see `Deviations` for the attributes."""

    def cells(self) -> list[list[str]]:
        """Return the contributions to each signal, largest first, without those below 0.1 % of the worst case."""
        headers = ["contribution", "signal", "size", "influence", "worst case", "share", "of variance"]
        listed = [(s, x) for s in self.signals for x in self.contributions(s) if x.share >= SHOWN]
        return [headers, *(self._row(signal, x) for signal, x in listed)]

    def _row(self, signal: str, x: Contribution) -> list[str]:
        """Return the cells of a contribution."""
        unit, size_unit = self.units[signal], self.parameter_units.get(x.name, "m" if x.name in self.clearances else "")
        ratio = (f"{unit}/{size_unit}" if size_unit != unit else "") if size_unit else unit
        cells = [quantity(x.size, size_unit, ".4g"), quantity(x.influence, ratio), quantity(x.worst, unit, ".4g")]
        return [x.name, signal, *cells, *(f"{100 * share:.1f} %" for share in (x.share, x.variance_share))]

    def remarks(self) -> list[str]:
        """Return worst cases by signal, and where the linear analysis is invalid."""
        lines = []
        for m, name in enumerate(self.signals):
            i, unit = self.worst_pose(name), self.units[name]
            at = f"at {self._at(i)}"
            worst, statistical = (quantity(x[m, i], unit, ".4g") for x in (self.worst, self.statistical))
            nominal = quantity(rounded_zero(self.influences.values[m, i]), unit)
            lines.append(f"{name}: worst case {worst}, statistical {statistical}, nominal {nominal}, {at}")
            text = f"  standard deviation {quantity(self.deviation[m, i], unit, '.4g')}"
            if self.hessians is not None:
                second = quantity(self.second_order_deviation[m, i], unit, ".4g")
                text += f", to second order {second}, mean {quantity(self.mean_shift[m, i], unit, '+.3g')}"
            small = sum(x.share < SHOWN for x in self.contributions(name))
            lines.append(text + (f"; {small} contributions below {100 * SHOWN:g} %" if small else ""))
        if self.left_out:
            lines.append(f"omitted, since they would violate redundant closures: {', '.join(self.left_out)}")
        return lines + self._warnings()

    def _warnings(self) -> list[str]:
        """Return remarks on poses near dead points and where closures lose rank."""
        out, condition = [], self.influences.condition
        if np.isfinite(condition).any():
            i = int(np.nanargmax(condition))
            out.append(f"condition number of G: up to {condition[i]:.3g}, at {self._at(i)}")
        if self.curve.dead_points:
            points = (rounded_zero(u) for u, _ in self.curve.dead_points)
            listed = ", ".join(f"{displayed(u, self.curve.unit)[0]:.6g}" for u in points)
            out.append(f"dead points of the input joint at {listed}: influences grow without bound towards them")
        limits = (
            (UNREACHABLE, "the mechanism may not assemble at this input with all dimensions within tolerance"),
            (NONLINEAR, f"the linear worst case is wrong by more than {100 * NONLINEAR:.0f} %"),
        )
        for limit, text in limits:
            affected = np.flatnonzero(self.nonlinearity >= limit)
            if len(affected):
                poses = f"{len(affected)} of {len(self.curve.u)} poses, first at {self._at(affected[0])}"
                out.append(f"near dead points {text}: in {poses}")
        return out

    def _at(self, i: int) -> str:
        return f"{self.curve.drive} = {quantity(rounded_zero(self.curve.u[i]), self.curve.unit)}"

    def to_columns(self) -> Columns:
        """Return the input, signals, deviations, condition and influences as columns."""
        out, units = {"u": self.curve.u}, {"u": self.curve.unit}
        for m, name in enumerate(self.signals):
            deviations = {"worst": self.worst, "statistical": self.statistical, "deviation": self.deviation}
            if self.hessians is not None:
                deviations |= {"mean_shift": self.mean_shift, "second_order_deviation": self.second_order_deviation}
            found = {name: self.influences.values[m], **{f"{key}.{name}": x[m] for key, x in deviations.items()}}
            out |= found
            units |= dict.fromkeys(found, self.units[name])
            out |= {
                f"influence.{name}.{p}": self.influences.derivatives[m, :, i] for i, p in enumerate(self.tolerances)
            }
            k = len(self.tolerances)
            out |= {f"influence.{name}.{c}": self.magnitudes[m, :, k + i] for i, c in enumerate(self.clearances)}
        return Columns({**out, "condition": self.influences.condition, "nonlinearity": self.nonlinearity}, units, "u")

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "title": self.curve.mechanism.title,
            "drive": self.curve.drive,
            "unit": self.curve.unit,
            "units": self.units,
            "tolerances": self.tolerances,
            "clearances": self.clearances,
            "left_out": list(self.left_out),
            "sigmas": self.sigmas,
            "contributions": {name: [x._asdict() for x in self.contributions(name)] for name in self.signals},
            "dead_points": [u for u, _ in self.curve.dead_points],
            "remarks": self.remarks(),
            "table": {name: column.tolist() for name, column in self.to_columns().values.items()},
        }

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw deviations versus the input, and bands around paths; saved if a path is given.

        Raises:
            InputError: for a format other than .png, .svg, .pdf or .pgf, or an unwritable path.
        """
        from .. import figures
        from .figure import bands

        return figures.save_if_path(bands(self), path)

    def __str__(self) -> str:
        curve, unit = self.curve, unit_name(self.curve.unit)
        head = f"tolerances of {curve.mechanism.title} over {curve.drive} ({unit}), {len(curve.u)} poses, "
        table = align_columns(self.cells())
        return "\n".join([f"{head}{self.sigmas:g} sigma", *(f"  {x}" for x in [*table, *self.remarks()])])
