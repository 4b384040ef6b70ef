"""Wheels and balls that stick or slide, with a friction coefficient."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...tolerances import COINCIDENT
from ..forces.coulomb_friction import CoulombFriction
from .switch import Guard, LoadCandidate, Switch, Value

if TYPE_CHECKING:
    from ...system import Array
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

IDLE, GRIPS, SLIDES = 0, 1, 2
ACROSS = 10  # velocity tolerances: where the slip ends along its direction, errors of the run are left across it


class RollingStiction(Switch):
    """No-slip rows with |lam_t| <= mu_s N while sticking, and a force mu N opposing the slip while sliding.

    Args:
        force: the friction force.
        rows: the height row and the no-slip rows.
        which: index among the frictions of closures.
    """

    takes_impulse = False
    states = ("idle", "grips", "slides")

    def __init__(self, force: CoulombFriction, rows: Sequence[int], which: int) -> None:
        super().__init__(f"{force.closure} grip")
        self.limit = force.coefficient if force.static is None else force.static
        self.height, self.grip, self.which = rows[0], list(rows[1:]), which

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        found = [f for f in mechanism.forces if isinstance(f, CoulombFriction)]
        pressing = {c.name for c in mechanism.closures if c.is_unilateral}
        return [
            cls(f, mechanism.rows_of(f.closure), k)
            for k, f in enumerate(found)
            if f.sticks and f.closure not in pressing
        ]

    @property
    def rows(self) -> tuple[int, ...]:
        return tuple(self.grip)

    def friction_ratio(self, lam: "Array") -> "Array":
        """Return the friction along the no-slip rows as a fraction of its limit."""
        return lam[self.grip] / max(self.limit * abs(float(lam[self.height])), np.finfo(float).tiny)

    def margin(self, point: "ModePoint") -> float:
        """Return the remaining friction as a fraction of its limit."""
        return 1.0 - float(np.linalg.norm(self.friction_ratio(point.lam)))

    def slip(self) -> Value:
        """Return the slip along its direction at the first evaluation."""
        first: list[Array] = []

        def value(point: "ModePoint") -> float:
            slip = point.rate[self.grip]
            if not first:
                first.append(self.direction(point))
            return float(slip @ first[0])

        return value

    def slips(self, point: "ModePoint") -> bool:
        """Return whether it slides."""
        return bool(np.linalg.norm(point.rate[self.grip]) > ACROSS * point.velocity_tolerance(self.grip[0]))

    def direction(self, point: "ModePoint") -> "Array":
        """Return the direction of the slip, or of the impending slip."""
        if self.slips(point):
            slip = point.rate[self.grip]
            return slip / np.linalg.norm(slip)
        return point.system.closure_friction.directions[self.which]

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == GRIPS:
            ratio = lambda x: self.friction_ratio(x.lam)  # noqa: E731
            return (Guard("slip", self.name, self.at, self.margin, loads=True, load=ratio),)
        return (Guard("rest", self.name, self.at, self.slip()),) if state == SLIDES else ()

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        if self.slips(point) or (state == GRIPS and self.margin(point) < COINCIDENT):
            return ()
        system, before = point.system, point.system.mode
        system.enter(tuple(GRIPS if i == self.at else k for i, k in enumerate(before)))
        lam = system.derivative(point.t, point.y)[1]
        system.enter(before)
        if np.linalg.norm(self.friction_ratio(lam)) > 1.0:
            self._head(point, lam)
            return ()
        return tuple(LoadCandidate(row) for row in self.grip)

    def _head(self, point: "ModePoint", lam: "Array") -> None:
        size = float(np.linalg.norm(lam[self.grip]))
        if size:
            point.system.closure_friction.directions[self.which][:] = -lam[self.grip] / size

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool
    ) -> int:
        if held:
            return GRIPS
        if point.system.mode[self.at] == GRIPS:
            self._head(point, point.lam)
        point.system.closure_friction.directions[self.which][:] = self.direction(point)
        return SLIDES

    def enter(self, system: "Index2System", state: int) -> None:
        system.closure_friction.active[self.which] = state == SLIDES
