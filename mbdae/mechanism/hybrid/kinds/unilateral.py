"""Unilateral contacts: stops, planes, ropes, wheels that lift off."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ....data_types import CoreData
from ....system import Array
from ....tolerances import CLOSED as CLOSED_GAP
from ....tolerances import SHORTEST_FLIGHT
from ...closures.closure import UnilateralClosure
from ...closures.unilateral_constraint import Stop, UnilateralOptions
from ...forces.coulomb_friction import CoulombFriction
from ..switch import CandidateRow, Guard, ImpactRow, SampledMotion, Switch, UnilateralRow, core_switch

if TYPE_CHECKING:
    from ...formulations.index2 import Index2System
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

OPEN, CLOSED = 0, 1


class Unilateral(UnilateralRow):
    """A row with a gap: sign g >= 0, sign lam >= 0, complementary; the other rows of its closure switch with it.

    Args:
        spec: the stop or closure.
        name: name of the switch.
        row: index of the row.
        sign: 1 if the gap is g, -1 if it is -g.
        other_rows: rows that are active while the contact is closed (no-slip rows of a wheel).
    """

    def __init__(
        self, spec: UnilateralOptions, name: str, row: int, sign: float, other_rows: tuple[int, ...] = ()
    ) -> None:
        super().__init__(name, row, sign)
        self.other_rows, self.restitution, self.rest = other_rows, spec.restitution or 0.0, spec.rest or SHORTEST_FLIGHT

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        out: list[Switch] = []
        frictional = {f.closure for f in mechanism.forces if isinstance(f, CoulombFriction) and f.is_exact}
        for spec in mechanism.constraints:
            rows = mechanism.rows_of(spec.name)
            if isinstance(spec, Stop):
                named = zip(spec.one_sided_names, rows, spec.one_sided_limits, strict=True)
                out += [cls(spec, name, row, side) for name, row, (_, side) in named]
            elif isinstance(spec, UnilateralClosure) and spec.unilateral and spec.name not in frictional:
                out.append(cls(spec, spec.name, rows[0], spec.free_side, tuple(rows[1:])))
        return out

    @property
    def rows(self) -> tuple[int, ...]:
        return (self.row, *self.other_rows)

    def gap(self, point: "ModePoint") -> float:
        """Return the contact gap, positive if open."""
        return self.sign * float(point.g[self.row])

    def margins(self, motion: SampledMotion) -> tuple[Array, Array]:
        return self.sign * motion.g[:, self.row], self.sign * motion.rate[:, self.row]

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == OPEN:
            return (Guard("contact", self.name, self.index, self.gap, self.speed, self.acceleration),)
        return (self.separation_guard(),)

    def core_data(self, system: "Index2System") -> CoreData:
        return core_switch(self, "contact", sign=self.sign)

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        if state != CLOSED and self.gap(point) > tolerance * point.system.mechanism.row_scales[self.row]:
            return ()
        return (ImpactRow(self.row, self.sign, self.restitution), *(ImpactRow(row, 0.0) for row in self.other_rows))

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        if state != CLOSED and self.gap(point) > tolerance * point.system.mechanism.row_scales[self.row]:
            return ()
        return (CandidateRow.unilateral(self.row, self.sign), *(CandidateRow(row) for row in self.other_rows))


def gaps(point: "ModePoint") -> list[tuple[Switch, float]]:
    """Return the contacts of a mechanism, each with its gap at a point, in m or rad."""
    switches = point.system.mechanism.switches
    return [(s, g.value(point)) for s in switches for g in s.guards(OPEN) if g.kind == "contact"]


def closed_contacts(point: "ModePoint", tolerance: float) -> list[str]:
    """Return the names of contacts whose gaps at a point are within a tolerance, relative to their scales."""
    scales = point.system.mechanism.row_scales
    return [s.name for s, gap in gaps(point) if abs(gap) <= tolerance * scales[s.rows[0]]]


def penetration_message(point: "ModePoint") -> str:
    """Return a message on the first contact with a negative gap; empty if there is none."""
    mech = point.system.mechanism
    found = [(s, gap) for s, gap in gaps(point) if gap < -CLOSED_GAP * mech.row_scales[s.rows[0]]]
    return next((f"{s.name!r} is penetrated by {-gap:.3g} {mech.row_units[s.rows[0]]}" for s, gap in found), "")
