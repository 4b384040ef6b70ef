"""Unilateral contacts with friction: open, sticking or sliding."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...tolerances import VISIBLE
from ..closures.closure import UnilateralClosure
from ..forces.coulomb_friction import CoulombFriction
from .rolling_stiction import RollingStiction
from .switch import Guard, ImpactRow, LoadCandidate, Switch
from .unilateral import Unilateral

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

OPEN, GRIPS, SLIDES = 0, 1, 2
CLOSE = 2*VISIBLE  # of the limit: loads closer to it have reached it, and the contact slides


class FrictionalContact(Unilateral):
    """A unilateral height row, N >= 0, and one no-slip row with |lam_t| <= mu N; friction mu N while sliding.

    Args:
        spec: the closure.
        force: the friction force.
        rows: the height row and the no-slip row.
        which: index of the friction among those of closures.
    """

    states = ("open", "grips", "slides")

    def __init__(self, spec: UnilateralClosure, force: CoulombFriction, rows: Sequence[int], which: int) -> None:
        super().__init__(spec, spec.name, rows[0], 1.0)
        self.grip, self.limit, self.friction = rows[1], force.coefficient, RollingStiction(force, rows, which)

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        found = [f for f in mechanism.forces if isinstance(f, CoulombFriction)]
        opening = {c.name: c for c in mechanism.closures if isinstance(c, UnilateralClosure) and c.unilateral}
        return [
            cls(opening[f.closure], f, mechanism.rows_of(f.closure), k)
            for k, f in enumerate(found)
            if f.sticks and f.closure in opening
        ]

    @property
    def rows(self) -> tuple[int, ...]:
        return (self.row, self.grip)

    def active(self, state: int) -> tuple[int, ...]:
        return self.rows if state == GRIPS else (self.row,) if state == SLIDES else ()

    def guards(self, state: int) -> tuple[Guard, ...]:
        friction_guards = tuple(g._replace(name=self.name, at=self.at) for g in self.friction.guards(state))
        return (*super().guards(min(state, 1)), *friction_guards)

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        found = super().impact_rows(point, min(state, 1), near)
        return (*found, ImpactRow(self.grip, 0.0, share=self.limit)) if found else ()

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        found = super().load_candidates(point, min(state, 1), near)
        if not found:
            return ()
        drag = -self.limit * float(self.friction.direction(point)[0]) if self.slips(point) else np.nan
        return (*found, LoadCandidate(self.grip, share=self.limit, drag=drag))

    def slips(self, point: "ModePoint") -> bool:
        """Return whether it slides."""
        return self.friction.slips(point)

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool
    ) -> int:
        if not held:
            return OPEN
        heading = point.system.closure_friction.directions[self.friction.which]
        if self.slips(point):
            heading[:] = self.friction.direction(point)
            return SLIDES
        if abs(lam[1]) < (1 - CLOSE) * self.limit * abs(lam[0]):
            return GRIPS
        heading[:] = -np.sign(lam[1])
        return SLIDES

    def enter(self, system: "Index2System", state: int) -> None:
        self.friction.enter(system, state)
