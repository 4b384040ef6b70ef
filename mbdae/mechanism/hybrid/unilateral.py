"""Unilateral rows: stops, planes, ropes, wheels that lift off."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...system import Array
from ...tolerances import SHORTEST_FLIGHT
from ..closures.closure import UnilateralClosure
from ..closures.unilateral_constraint import Stop, UnilateralOptions
from ..forces.coulomb_friction import CoulombFriction
from .switch import Guard, ImpactRow, LoadCandidate, Margins, Switch, UnilateralRow

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

OPEN, CLOSED = 0, 1


class Unilateral(UnilateralRow):
    """A row with a gap: sign g >= 0, sign lam >= 0, complementary; other rows of its closure switch with it.

    Args:
        spec: the stop or closure.
        name: of the switch.
        row: its index.
        sign: 1 if g > 0 is free, -1 if g < 0 is.
        others: rows that are active while it is closed (no-slip rows of a wheel).
    """

    def __init__(self, spec: UnilateralOptions, name: str, row: int, sign: float, others: tuple[int, ...] = ()) -> None:
        super().__init__(name, row, sign)
        self.others, self.restitution, self.rest = others, spec.restitution or 0.0, spec.rest or SHORTEST_FLIGHT

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        out: list[Switch] = []
        frictional = {f.closure for f in mechanism.forces if isinstance(f, CoulombFriction) and f.sticks}
        for spec in mechanism.constraints:
            rows = mechanism.rows_of(spec.name)
            if isinstance(spec, Stop):
                words = {1.0: "lower", -1.0: "upper"}
                out += [
                    cls(spec, f"{spec.name} {words[side]}" if len(rows) > 1 else spec.name, row, side)
                    for row, (_, side) in zip(rows, spec.one_sided_limits, strict=True)
                ]
            elif isinstance(spec, UnilateralClosure) and spec.unilateral and spec.name not in frictional:
                out.append(cls(spec, spec.name, rows[0], spec.free_side, tuple(rows[1:])))
        return out

    @property
    def rows(self) -> tuple[int, ...]:
        return (self.row, *self.others)

    def gap(self, point: "ModePoint") -> float:
        """Return the gap, positive if open."""
        return self.sign * float(point.g[self.row])

    def margins(self, motion: Margins) -> tuple[Array, Array]:
        return self.sign * motion.g[:, self.row], self.sign * motion.rate[:, self.row]

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == OPEN:
            return (Guard("touch", self.name, self.at, self.gap, self.speed, self.acceleration),)
        return (Guard("let go", self.name, self.at, self.load, loads=True, load=self.load),)

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        if state != CLOSED and self.gap(point) > near * point.system.mechanism.row_scales[self.row]:
            return ()
        return (ImpactRow(self.row, self.sign, self.restitution), *(ImpactRow(row, 0.0) for row in self.others))

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        if state != CLOSED and self.gap(point) > near * point.system.mechanism.row_scales[self.row]:
            return ()
        return (LoadCandidate.unilateral(self.row, self.sign), *(LoadCandidate(row) for row in self.others))
