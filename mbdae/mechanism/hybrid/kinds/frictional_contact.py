"""Unilateral contacts with friction: open, sticking or sliding."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ....data_types import CoreData
from ....errors import InputError
from ....tolerances import VISIBLE
from ...closures.closure import UnilateralClosure
from ...forces.coulomb_friction import CoulombFriction
from ..switch import CandidateRow, Guard, ImpactRow, Switch
from .rolling_stiction import RollingStiction
from .unilateral import Unilateral

if TYPE_CHECKING:
    from ...formulations.index2 import Index2System
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

OPEN, STICKING, SLIDING = 0, 1, 2
AT_LIMIT = 2 * VISIBLE  # fraction of the friction limit: the contact slides if its friction is closer to the limit


class FrictionalContact(Unilateral):
    """A unilateral normal row, N >= 0, and one no-slip row with |lam_t| <= mu N; friction mu N while sliding.

    Args:
        spec: the closure.
        force: the friction force.
        rows: indices of the normal row and the no-slip row.
        friction_index: index among the friction interfaces of closures.
    """

    states = ("open", "sticking", "sliding")

    def __init__(
        self, spec: UnilateralClosure, force: CoulombFriction, rows: Sequence[int], friction_index: int
    ) -> None:
        super().__init__(spec, spec.name, rows[0], 1.0)
        if len(rows) < 2:
            raise InputError(f"friction of {spec.name!r}: exact friction belongs to closures of kind rolling with grip")
        self.no_slip, self.coefficient = rows[1], force.coefficient
        self.friction = RollingStiction(force, rows, friction_index)

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        found = [f for f in mechanism.forces if isinstance(f, CoulombFriction)]
        unilateral = {c.name: c for c in mechanism.closures if isinstance(c, UnilateralClosure) and c.unilateral}
        return [
            cls(unilateral[f.closure], f, mechanism.rows_of(f.closure), k)
            for k, f in enumerate(found)
            if f.is_exact and f.closure in unilateral
        ]

    @property
    def rows(self) -> tuple[int, ...]:
        return (self.row, self.no_slip)

    def active_rows(self, state: int) -> tuple[int, ...]:
        return self.rows if state == STICKING else (self.row,) if state == SLIDING else ()

    def guards(self, state: int) -> tuple[Guard, ...]:
        friction_guards = tuple(g._replace(name=self.name, switch=self.index) for g in self.friction.guards(state))
        return (*super().guards(min(state, 1)), *friction_guards)

    def core_data(self, system: "Index2System") -> CoreData:
        limits = {"friction": self.coefficient, "limit": self.friction.limit}
        return {**super().core_data(system), **limits, "interface": self.friction.friction_index}

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        found = super().impact_rows(point, min(state, 1), tolerance)
        return (*found, ImpactRow(self.no_slip, 0.0, friction=self.coefficient)) if found else ()

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        found = super().candidate_rows(point, min(state, 1), tolerance)
        if not found:
            return ()
        sliding_ratio = -self.coefficient * float(self.friction.direction(point)[0]) if self.slips(point) else np.nan
        return (*found, CandidateRow(self.no_slip, friction=self.coefficient, sliding_ratio=sliding_ratio))

    def slips(self, point: "ModePoint") -> bool:
        """Return whether the contact slides."""
        return self.friction.slips(point)

    def next_state(self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool) -> int:
        if not active:
            return OPEN
        slip_direction = point.system.closure_friction.directions[self.friction.friction_index]
        if self.slips(point):
            slip_direction[:] = self.friction.direction(point)
            return SLIDING
        if abs(lam[1]) < (1 - AT_LIMIT) * self.coefficient * abs(lam[0]):
            return STICKING
        slip_direction[:] = -np.sign(lam[1])
        return SLIDING

    def enter(self, system: "Index2System", state: int) -> None:
        self.friction.enter(system, state)
