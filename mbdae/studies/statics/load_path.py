"""Equilibria under a quasi-statically varied load: load-deflection curves through limit points."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, is_number, require
from ...mechanism import Mechanism, ModelSource
from ...mechanism.equilibrium.spectrum import curvature
from ...mechanism.flexible.linear_range import beyond_linear
from ...mechanism.signals.deformation import deformation, deformation_units
from ...mechanism.tree.coordinate_units import coordinate_units
from ...solution.columns import coordinates
from ...solution.problem import mechanism_of
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from ...units import displayed
from .contact_changes import ContactMode
from .contacts import Contacts, find_equilibrium_on_contacts
from .continuation import Continuation
from .equilibrium import complete_arguments
from .path_point import CriticalPoint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...mechanism.mechanism import Coordinates

__all__ = ["load_path"]

SPAN = "a path leads from one factor to another, as (0, 1)"


@dataclass(frozen=True)
class LoadPath(Tabular):
    """Result of `load_path`.

    Attributes:
        mechanism: the mechanism.
        load: name of the force that is scaled.
        factor: factor on the load along the path, (n,).
        q: configurations, (n, nq).
        unstable: number of negative eigenvalues of the stiffness, (n,).
        critical: limit points, branch points, and contacts that close or open.
        complete: whether the path reached the end of the range.
        potential: whether forces have a potential along the path: then no branch point can be missed.
        contacts: normal forces of contacts that close on the path, in N or N m, by name, (n,) each; 0 while open.
    """

    mechanism: Mechanism
    load: str
    factor: Array
    q: Array
    unstable: Array
    critical: tuple[CriticalPoint, ...]
    complete: bool
    potential: bool = True
    contacts: dict[str, Array] = field(default_factory=dict)

    @property
    def coordinates(self) -> dict[str, Array]:
        """The configurations by names ``q.<joint>``, (n,) each, see `mbdae.Solution.signals`."""
        n, mech = len(self.q), self.mechanism
        zeros = np.zeros((n, mech.nv + len(mech.states) + 1))
        y = np.hstack([self.q, zeros])
        lam = np.full((n, mech.ng), np.nan)
        found = coordinates(Solution(mech, np.arange(n, dtype=float), y, lam, "finished", "", {}, {}))
        return {name: x for name, x in found.items() if name.startswith("q.")}

    @property
    def deformation(self) -> dict[str, Array]:
        """Displacements, strains and stresses of nodes of flexible bodies by names of signals, (n,) each."""
        return deformation(self.mechanism.model, self.q)

    @property
    def warning(self) -> str:
        """Name of a flexible body that bends beyond the range of linear modes, and the factor at which; else empty."""
        if not (text := beyond_linear(self.mechanism.model, self.q)):
            return ""
        first = next(i for i in range(len(self.q)) if beyond_linear(self.mechanism.model, self.q[i : i + 1]))
        return f"{text}, from factor {self.factor[first]:.6g} on"

    @property
    def moving(self) -> str:
        """The coordinate with the largest range."""
        return max(self.coordinates.items(), key=lambda item: float(np.ptp(item[1])))[0]

    def plot(self, path: str | Path | None = None, coordinate: str | None = None) -> "Figure":
        """Draw the load against a coordinate, by default that with the largest range; saved if a path is given.

        Raises:
            UnknownNameError: for a coordinate that does not exist.
            InputError: for another format, or an unwritable path.
        """
        from .. import figures
        from .figure import load_deflection

        return figures.save_if_path(load_deflection(self, coordinate), path)

    def to_columns(self) -> Columns:
        """Return factor, coordinates, deformation, numbers of negative eigenvalues, and normal forces on the path."""
        known = coordinate_units(self.mechanism) | deformation_units(self.mechanism.model)
        found = self.coordinates | self.deformation
        columns = {"factor": self.factor, **found, "unstable": self.unstable}
        columns |= {f"contact.{name}": force for name, force in self.contacts.items()}
        return Columns(columns, {name: known[name] for name in found if name in known})

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "title": self.mechanism.title,
            "load": self.load,
            "complete": self.complete,
            "potential": self.potential,
            "factor": self.factor.tolist(),
            "coordinates": {name: x.tolist() for name, x in self.coordinates.items()},
            "deformation": {name: x.tolist() for name, x in self.deformation.items()},
            "unstable": self.unstable.tolist(),
            "contacts": {name: x.tolist() for name, x in self.contacts.items()},
            "critical": [e.to_dict() for e in self.critical],
            "warning": self.warning,
        }

    def __str__(self) -> str:
        name, values = self.moving, self.coordinates[self.moving]
        values, unit = displayed(values, coordinate_units(self.mechanism).get(name, ""))
        lines = [
            f"path of {self.mechanism.title} under {self.load}: {len(self.factor)} equilibria, "
            f"factor {self.factor[0]:.6g} to {self.factor[-1]:.6g}, {name} {values[0]:.6g} to {values[-1]:.6g} {unit}"
        ]
        texts = {"limit": "limit point: snap-through", "branch": "branch point: buckling"}
        lines += [f"  begins on {name}" for name, force in self.contacts.items() if force[0]]
        texts |= {"contact": "{} closes", "separation": "{} opens"}
        lines += [
            f"  {texts[e.kind].format(e.contact)} at factor {e.factor:.12g}{_several(e)}"
            f"{', where the load reverses' * (e.reverses and bool(e.contact))}"
            for e in self.critical
        ]
        if not self.potential:
            lines.append("  forces have no potential: branch points with double roots may be missing")
        fraction = float((self.unstable > 0).mean())
        lines.append(f"  {100 * fraction:.0f} % of the equilibria are unstable")
        lines += [f"  doubtful: {warning}"] if (warning := self.warning) else []
        return "\n".join(lines if self.complete else [*lines, "  the path did not reach the end of the range"])


def _several(point: CriticalPoint) -> str:
    return f", in {point.multiplicity} shapes at once" if point.multiplicity > 1 else ""


def load_path(
    mech: Mechanism | ModelSource,
    load: str,
    span: Sequence[float] = (0.0, 1.0),
    q: "Coordinates | Array | None" = None,
    *,
    t: float = 0.0,
    v: "Coordinates | Array | None" = None,
    hold: str | Iterable[str] = (),
) -> LoadPath:
    """Trace an equilibrium while a force is scaled from one factor p to another.

        0 = f(t, q, v) + (p - 1) f_load + G^T lam,   0 = g(t, q)

    by continuation in arclength, so that p may reverse at limit points. Stops, ropes and planes may support the
    mechanism; they close and open along the path, with compressive forces. Source: Keller, Numerical solution of
    bifurcation and nonlinear eigenvalue problems (1977).

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        load: the scaled force, without states, or gravity.
        span: the first and the last factor on the load.
        q: start of the search for the first equilibrium, see `mbdae.equilibrium`, also for t, v and hold.
        t: time in s.
        v: constant speeds.
        hold: joints to lock.

    Returns:
        The path, through limit points.

    Raises:
        EquilibriumError: if no equilibrium is found at the first factor.
        UnknownNameError: for a force that does not exist.
        InputError: for an invalid span, or a mechanism without degrees of freedom.
    """
    mech = mechanism_of(mech, "load_path")
    require(span, Sequence | np.ndarray, SPAN)
    if len(span) != 2 or not all(map(is_number, span)) or span[0] == span[1]:
        raise InputError(f"{SPAN}, got {span!r:.60}")
    first, last = (float(x) for x in span)
    q0, speeds, locked, _ = complete_arguments(mech, q, t, v, hold)
    equilibrium = find_equilibrium_on_contacts(mech, t, speeds, locked, q0, "stable", [load], first)
    contacts = Contacts(mech, t)
    if not len(equilibrium.balance.rho) and not contacts.switches:
        raise InputError(f"{mech.title!r} has no degree of freedom left: nothing moves with the load")
    mode = ContactMode(contacts, equilibrium.closed)
    continuation = Continuation(equilibrium.statics, mode, [load], first, last - first)
    points, critical, complete = continuation.run(equilibrium.balance)
    unstable = [curvature(p.balance.H, p.balance.noise).negative for p in points]
    factor, q = np.array([first + (last - first) * p.u for p in points]), np.array([p.balance.q for p in points])
    potential = all(p.curvature is not None for p in points)
    forces = _normal_forces(contacts, np.array([p.balance.lam for p in points]))
    return LoadPath(mech, load, factor, q, np.array(unstable), tuple(critical), complete, potential, forces)


def _normal_forces(contacts: Contacts, lam: Array) -> dict[str, Array]:
    """Return the nonzero normal forces of contacts for multipliers (n, ng), by name, (n,) each."""
    normal = [contacts.normal_forces(row) for row in lam]
    return {s.name: x for s, x in zip(contacts.switches, np.transpose(normal), strict=True) if x.any()}
