"""Branches of periodic motions over a parameter, with their bifurcations."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, is_number
from ...mechanism import Mechanism
from ...mechanism.equations.symmetry import Symmetry
from ...mechanism.formats.mechanism_file.parameter_units import parameter_units
from ...system import Array
from ...tabular import Columns, Tabular
from ...tolerances import VISIBLE
from ...units import displayed, quantity
from ..factories import factory_of
from .branch_path import FIRST_STEP, BranchPath, Range
from .guess import guess_of
from .period import has_period
from .periodic import (
    GAP,
    RTOL,
    require_period_of_functions,
    require_positive_period,
    require_second_period,
    run_options,
    start_point,
)
from .result import Bifurcation, BranchMotion, multiplier_text
from .returns import points_of
from .shooting.newton import newton, require_motion
from .shooting.shooting_equations import Cycle, ShootingEquations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["periodic_branch"]

KINDS = {
    "fold": "fold, two motions meet",
    "doubling": "period doubling, a multiplier is -1",
    "neimark-sacker": "Neimark-Sacker, a complex pair of multipliers has magnitude 1",
    "branch": "branch point, a multiplier is 1",
    "grazing": "{} is grazed",
}


@dataclass(frozen=True)
class Branch(Tabular):
    """Result of `periodic_branch`.

    Attributes:
        name: name of the parameter.
        points: points of the branch, in order.
        bifurcations: bifurcations of the branch.
        message: why the branch ended; empty at the end of the range.
        path: equations of the branch, from which further branches begin.
        unit: unit of the parameter; "" if unknown.
    """

    name: str
    points: tuple[BranchMotion, ...]
    bifurcations: tuple[Bifurcation, ...]
    message: str
    path: BranchPath
    unit: str = ""

    @property
    def values(self) -> Array:
        """Values of the parameter, (n,)."""
        return np.array([p.value for p in self.points])

    @property
    def multipliers(self) -> Array:
        """Multipliers at each point, (n, m), complex, by decreasing magnitude."""
        return np.array([p.motion.multipliers for p in self.points])

    def amplitudes(self, signal: str) -> tuple[Array, Array]:
        """Return the least and the largest value of a signal at the nodes of the runs of each motion, (n,) each.

        Raises:
            UnknownNameError: for an unknown signal.
        """
        found = [p.motion.extrema(signal) for p in self.points]
        low, high = np.array(found).T
        return low, high

    def doubled(self, at: Bifurcation, *, step: float = FIRST_STEP) -> "Branch":
        """Return the branch of twice the period that begins at a period doubling.

        Args:
            at: a period doubling of this branch.
            step: first distance along the new branch, in rad and characteristic lengths.

        Raises:
            InputError: for another bifurcation, or if no motion of twice the period is found.
        """
        if at.kind != "doubling":
            raise InputError(f"a branch of twice the period begins at a period doubling, got {at.kind!r}")
        points, found, message = self.path.doubled(at, step)
        return Branch(self.name, tuple(points), tuple(found), message, self.path, self.unit)

    def to_columns(self) -> Columns:
        """Return period, stability and multipliers over the parameter."""
        columns: dict[str, Any] = {self.name: self.values, "T": np.array([p.motion.T for p in self.points])}
        for i in range(self.multipliers.shape[1]):
            columns |= {f"re.{i + 1}": self.multipliers[:, i].real, f"im.{i + 1}": self.multipliers[:, i].imag}
        return Columns(columns, {"T": "s"} | ({self.name: self.unit} if self.unit else {}), self.name)

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "parameter": self.name,
            "points": [{"value": p.value, **p.motion.to_dict()} for p in self.points],
            "bifurcations": [b.to_dict() for b in self.bifurcations],
            "message": self.message,
        }

    def plot(self, path: str | Path | None = None, *, signal: str = "") -> "Figure":
        """Draw amplitudes, period and magnitudes of multipliers against the parameter; optionally saved.

        Args:
            path: file to write.
            signal: signal whose extrema are drawn; the first coordinate when left out.

        Raises:
            InputError: for another format, or an unwritable path.
            UnknownNameError: for an unknown signal.
        """
        from .. import figures
        from .figure import branch

        return figures.save_if_path(branch(self, signal), path)

    def __str__(self) -> str:
        first, last = self.points[0], self.points[-1]
        title = f"periodic motions of {first.motion.mechanism.title} over {self.name}"
        span = f"{displayed(first.value, self.unit)[0]:.9g} to {quantity(last.value, self.unit, '.9g')}"
        lines = [f"{title}, {span}: {len(self.points)} points"]
        for p in (first, last):
            largest = p.motion.multipliers[0] if len(p.motion.multipliers) else 0j
            value, period = quantity(p.value, self.unit, ".9g"), quantity(p.motion.T, "s", ".9g")
            lines.append(
                f"  {self.name} = {value}: T = {period}, {p.motion.stability},"
                f" largest multiplier {multiplier_text(complex(largest.real, abs(largest.imag)))}"
            )
        for b in self.bifurcations:
            value = quantity(b.value, self.unit, ".12g")
            lines.append(f"  {self.name} = {value}: {KINDS[b.kind].format(repr(b.grazed))}")
        return "\n".join([*lines, *([f"  {self.message}"] if self.message else [])])


def periodic_branch(
    model: Any,
    name: str,
    first: float,
    last: float,
    *,
    T: float | None = None,
    q: Mapping[str, float] | Array | None = None,
    v: Mapping[str, float] | Array | None = None,
    s: Array | None = None,
    section: str | None = None,
    symmetry: Sequence[str] | None = None,
    exchange: Mapping[str, str] | None = None,
    segments: int | None = None,
    method: str | None = None,
    rtol: float = RTOL,
    start: Mapping[str, Any] | None = None,
) -> Branch:
    """Follow a periodic motion over a parameter, through folds, and locate changes of stability and grazing.

    Args:
        model: a mechanism that was loaded, an argument of `mbdae.load`, or a function of the parameter.
        name: name of the parameter, as in `mbdae.sweep`.
        first: value of the parameter at the beginning.
        last: value of the parameter at the end.
        T: period in s: fixed if the mechanism is driven, else an estimate.
        q: guess of the configuration at ``first``: joint = value, or (nq,).
        v: guess of the velocity: joint = value, or (nv,).
        s: guess of the states of forces, (ns,).
        section: signal and level at which a period begins and ends.
        symmetry: symmetry along which the motion advances in a period, see `mbdae.periodic`.
        exchange: joints that are exchanged at the end of a period, see `mbdae.periodic`.
        segments: number of segments of multiple shooting.
        method: method of the runs.
        rtol: relative tolerance of the runs.
        start: further parameters, constant.

    Raises:
        InputError: if no periodic motion is found at ``first``.
        UnknownNameError: for an unknown model, parameter, signal or symmetry.
    """
    require_positive_period(T)
    if not (is_number(first) and is_number(last) and first != last):
        raise InputError(f"the range of {name!r} is two different numbers, got {first!r:.40} and {last!r:.40}")
    first, last = float(first), float(last)  # numpy's single precision would end the branch
    factory, constants = factory_of(model), dict(start or {})
    factory.check({n: x for n, x in {**constants, name: first}.items() if n not in factory.parameters})
    mech = factory.make({**constants, name: first})
    path = BranchPath(factory, Range(name, first, last), constants, run_options(mech, method, rtol), GAP * rtol)
    y = start_point(mech, q, v, s)
    cycle, guess = guess_of(path.flow(first, 0.0, y), y, T, 0.0, section, symmetry, segments, exchange)
    other = factory.make({**constants, name: last})
    require_same_directions(cycle, guess.nodes[0][: mech.nq], other, name)
    if cycle.period_is_given:
        with suppress(InputError):  # of functions whose period is not known
            cycle = replace(cycle, periods=guess.T / path.period(first))
    found = newton(path.equations(cycle, guess, first), path.tolerance).refine_steps()
    path.options = found.flow.options
    found = newton(found, path.tolerance)
    require_motion(found)
    require_period_of_functions(found)
    require_second_period(found)
    require_same_period(found, other, name)
    first_point = path.point(found, None)
    if cycle.autonomous and any(x.name == "energy" for x in first_point.motion.neutral):
        raise InputError(
            f"the motion conserves its energy, and for each {name!r} motions of any energy are periodic: there is no"
            " single branch; add damping and a drive, or call mbdae.periodic for each value"
        )
    points, bifurcations, message = path.run(first_point)
    unit = parameter_units(factory, [name]).get(name, "")
    return Branch(name, tuple(points), tuple(bifurcations), message, path, unit)


def require_same_directions(cycle: Cycle, q: Array, other: Mechanism, name: str) -> None:
    """Require that symmetries that move bodies have the same directions for another value of the parameter.

    Raises:
        InputError: names a symmetry whose direction changes.
    """
    for symmetry in cycle.symmetries:
        if not symmetry.moves_bodies:
            continue
        (other_symmetry,) = Symmetry.named(other.system(), [symmetry.name])
        if np.abs(other_symmetry.twist(q) - symmetry.twist(q)).max() > VISIBLE:
            raise InputError(f"symmetry {symmetry.name!r} turns with {name!r}: turn gravity instead of the ground")


def require_same_period(found: ShootingEquations, other: Mechanism, name: str) -> None:
    """Require that a fixed period is that of the functions of time also for another value of the parameter.

    Raises:
        InputError: naming the parameter.
    """
    cycle = found.cycle
    if cycle.periods or not cycle.period_is_given or cycle.exchange:
        return
    points = [p for run in found.runs for p in points_of(run)]
    if not has_period(other, found.guess.T, points, found.guess.shifts):
        raise InputError(
            f"the period of forces and drivers changes with {name!r}: a branch follows that of harmonic functions,"
            " periodic tables, sampled controllers and constant speeds of joints that turn"
        )
