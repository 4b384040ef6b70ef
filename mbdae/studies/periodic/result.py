"""A periodic motion with its Floquet multipliers."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...data_types import JsonObject
from ...integrate.run.result import joined
from ...mechanism import Mechanism
from ...mechanism.tree.coordinate_units import coordinate_units
from ...solution.signals import signals
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from ...tolerances import HALF_DIGITS
from ...units import quantity
from .section import section_of
from .shooting.shooting_equations import ShootingEquations

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__: list[str] = []


@dataclass(frozen=True)
class UnitMultiplier:
    """A multiplier 1 that is due to a symmetry, the free phase or a conserved energy.

    Attributes:
        name: ``"time"``, a symmetry, or ``"energy"``.
        error: relative distance of the tangent over a period from the known map of its direction.
    """

    name: str
    error: float


@dataclass(frozen=True)
class PeriodicMotion(Tabular):
    """Result of `periodic`.

    Attributes:
        mechanism: the mechanism.
        T: period in s.
        t: time of the start.
        q: configuration at the start, (nq,).
        v: velocity, (nv,).
        s: states of forces, (ns,).
        multipliers: Floquet multipliers without the neutral ones, complex, by decreasing magnitude.
        neutral: neutral multipliers with their errors.
        advances: displacements along symmetries over a period, by name, in rad or m.
        shifts: shifts of joints by full turns or tooth pitches over a period, by name, in rad or m.
        gap: largest relative distance of the end of a segment from the next node, in rad and characteristic lengths.
        runs: one run for each segment of the period.
        shooting: the equations at the solution.
    """

    mechanism: Mechanism
    T: float
    t: float
    q: Array
    v: Array
    s: Array
    multipliers: Array
    neutral: tuple[UnitMultiplier, ...]
    advances: dict[str, float]
    shifts: dict[str, float]
    gap: float
    runs: tuple[Solution, ...]
    shooting: ShootingEquations = field(repr=False)

    @property
    def spectral_radius(self) -> float:
        """Largest magnitude of the multipliers that are not neutral; 0 if there are none."""
        return float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def stability(self) -> str:
        """``"stable"``, ``"unstable"``, ``"neutral"`` within 1e-8, ``"doubtful"`` if a neutral multiplier is not 1."""
        if any(not x.error <= HALF_DIGITS for x in self.neutral):
            return "doubtful"
        if abs(self.spectral_radius - 1) <= HALF_DIGITS:
            return "neutral"
        return "unstable" if self.spectral_radius > 1 else "stable"

    @property
    def start(self) -> dict[str, float]:
        """Coordinates and velocities at the start by name."""
        first = self.runs[0]
        return {name: float(x[0]) for name, x in signals(first, list(coordinate_units(self.mechanism))).items()}

    @cached_property
    def section(self) -> str:
        """Signal and level at which a period begins, as given, or found; empty if there is none."""
        cycle = self.shooting.cycle
        if cycle.section or not cycle.autonomous:
            return cycle.section or ""
        return section_of(self.mechanism, self.runs)

    @property
    def symmetry(self) -> tuple[str, ...]:
        """Names of the symmetries, as given or found."""
        return tuple(self.advances)

    @property
    def after(self) -> dict[str, dict[str, float]]:
        """Coordinates and velocities just after each event at which the state jumps, by the name of the event."""
        out: dict[str, dict[str, float]] = {}
        for run in self.runs:
            columns = signals(run, list(coordinate_units(self.mechanism)))
            for i, name in run.resets:
                key = name if name not in out else f"{name} {sum(x.startswith(name) for x in out) + 1}"
                out[key] = {name: float(x[i]) for name, x in columns.items()}
        return out

    @property
    def run(self) -> Solution:
        """One period as one run."""
        return joined(self.runs)

    def animate(self, path: str | Path) -> Path:
        """Write a replay page of one period, which repeats.

        Raises:
            InputError: for another suffix, or an unwritable path.
        """
        from ..replay.replay import animate

        return animate(self.run, path)

    def extrema(self, signal: str) -> tuple[float, float]:
        """Return the least and the largest value of a signal at the nodes of the runs.

        Raises:
            UnknownNameError: for an unknown signal.
        """
        values = np.concatenate([signals(run, [signal])[signal] for run in self.runs])
        return float(values.min()), float(values.max())

    def to_dict(self) -> JsonObject:
        """Return JSON data; multipliers as pairs [re, im]."""
        return {
            "title": self.mechanism.title,
            "T": self.T,
            "t": self.t,
            "q": self.q.tolist(),
            "v": self.v.tolist(),
            "s": self.s.tolist(),
            "start": self.start,
            "after": self.after,
            "multipliers": [[z.real, z.imag] for z in self.multipliers.tolist()],
            "neutral": {x.name: x.error for x in self.neutral},
            "advances": self.advances,
            "shifts": self.shifts,
            "section": self.section,
            "symmetry": list(self.symmetry),
            "stability": self.stability,
            "gap": self.gap,
        }

    def to_columns(self) -> Columns:
        """Return coordinates and velocities over one period."""
        units = {"t": "s", **coordinate_units(self.mechanism)}
        tables = [signals(run, list(units)) for run in self.runs]
        return Columns({name: np.concatenate([table[name] for table in tables]) for name in units}, units, "t")

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Draw one period in the phase plane, and the multipliers with the unit circle; optionally saved.

        Raises:
            InputError: for another format, or an unwritable path.
        """
        from .. import figures
        from .figure import motion

        return figures.save_if_path(motion(self), path)

    def __str__(self) -> str:
        period, units = quantity(self.T, "s", ".12g"), coordinate_units(self.mechanism)

        def text(name: str, x: float, digits: str) -> str:
            return quantity(x, units.get(name, ""), digits)

        lines = [f"periodic motion of {self.mechanism.title}: T = {period}, {self.stability}"]
        lines += [f"  begins at t = {quantity(self.t, 's', '.12g')}"] if self.t and not self.section else []
        lines += [f"  {name:24s} {text(name, x, ' .12g')}" for name, x in self.start.items()]
        lines += [f"  section {self.section}"] if self.section else []
        lines += [f"  symmetry {', '.join(self.symmetry)}"] if self.symmetry else []
        for event, values in self.after.items():
            lines += [f"  after {event!r}", *(f"    {n:22s} {text(n, x, ' .12g')}" for n, x in values.items())]
        lines += [f"  {n} advances by {text(n, x, '.12g')} per period" for n, x in self.advances.items()]
        lines += [f"  {n} is shifted by {text(n, x, '.12g')} per period" for n, x in self.shifts.items()]
        lines += [f"  multiplier {multiplier_text(z)}" for z in self.multipliers.tolist() if z.imag >= 0]
        lines += [f"  neutral: {x.name}, to {x.error:.1e}" for x in self.neutral]
        return "\n".join(lines)


class BranchMotion(NamedTuple):
    """A point of a branch.

    Attributes:
        value: value of the parameter.
        motion: the periodic motion.
        tangent: tangent of the branch: derivatives of the nodes, (k, ny), and of T, sigma and the parameter, (m,).
    """

    value: float
    motion: PeriodicMotion
    tangent: tuple[Array, Array]


@dataclass(frozen=True)
class Bifurcation:
    """A bifurcation of a branch.

    Attributes:
        kind: ``"fold"``, ``"doubling"``, ``"neimark-sacker"``, ``"branch"`` or ``"grazing"``.
        value: value of the parameter.
        motion: the periodic motion at the bifurcation; for grazing one close to it, which has derivatives.
        grazed: the stop, contact, joint or event whose guard has a double zero.
    """

    kind: str
    value: float
    motion: PeriodicMotion
    grazed: str = ""

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {"kind": self.kind, "value": self.value, "grazed": self.grazed, "motion": self.motion.to_dict()}


def multiplier_text(z: complex) -> str:
    """Return a multiplier, a conjugate pair or a real one, with its magnitude."""
    number = f"{z.real:.10g}" if z.imag == 0 else f"{z.real:.10g} +- {z.imag:.10g} i"
    return f"{number}, magnitude {abs(z):.10g}"
