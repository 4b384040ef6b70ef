"""Rolling bodies with a friction coefficient, which stick or slide."""

from collections.abc import Sequence
from math import inf, nextafter
from typing import TYPE_CHECKING

import numpy as np

from ....errors import StepError
from ....tolerances import COINCIDENT, PARALLEL
from ...forces.coulomb_friction import CoulombFriction
from ...formulations.friction_interface import CLEAR_SLIP
from ..switch import CandidateRow, Guard, PointFunction, Switch

if TYPE_CHECKING:
    from ....system import Array
    from ...formulations.index2 import Index2System
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

IDLE, STICKING, SLIDING = 0, 1, 2
MAX_ROTATION = 0.1  # rad: largest rotation of the slip direction within a fixed step
STABLE = 2.0  # stability limit of explicit methods: largest step times the decay rate of the slip
TRANSVERSE = 10  # velocity tolerances: slip that remains, transverse to its direction, when sliding ends


class RollingStiction(Switch):
    """No-slip rows with |lam_t| <= mu_s N while sticking, and a force mu N opposing the slip while sliding.

    Args:
        force: the friction force.
        rows: indices of the normal row and the no-slip rows.
        friction_index: index among the friction interfaces of closures.
    """

    takes_impulse = False
    states = ("idle", "sticking", "sliding")

    def __init__(self, force: CoulombFriction, rows: Sequence[int], friction_index: int) -> None:
        super().__init__(f"{force.closure} grip")
        self.limit = force.coefficient if force.static is None else force.static
        self.normal, self.no_slip, self.friction_index = rows[0], list(rows[1:]), friction_index

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        found = [f for f in mechanism.forces if isinstance(f, CoulombFriction)]
        unilateral = {c.name for c in mechanism.closures if c.is_unilateral}
        return [
            cls(f, mechanism.rows_of(f.closure), k)
            for k, f in enumerate(found)
            if f.is_exact and f.closure not in unilateral
        ]

    @property
    def rows(self) -> tuple[int, ...]:
        return tuple(self.no_slip)

    def friction_ratio(self, lam: "Array") -> "Array":
        """Return the friction along the no-slip rows as a fraction of its limit."""
        return lam[self.no_slip] / max(self.limit * abs(float(lam[self.normal])), np.finfo(float).tiny)

    def margin(self, point: "ModePoint") -> float:
        """Return the stiction margin as a fraction of the limit."""
        return 1.0 - float(np.linalg.norm(self.friction_ratio(point.lam)))

    def slip_guard(self) -> Guard:
        """Return the guard of sliding: the slip velocity along the slip direction at the first evaluation.

        A fixed step uses the slip direction at its start.
        """
        first: list[tuple[float, Array]] = []  # time and direction

        def value(point: "ModePoint") -> float:
            if not first:
                first.append((point.t, self.direction(point).copy()))  # the impending slip direction changes in place
            return float(point.rate[self.no_slip] @ first[0][1])

        def vanishes(point: "ModePoint", h: float) -> bool:
            slips = self.slips(point)
            if h and slips:  # the slip direction has rotated since the last fixed step
                first[0] = first[0][0], self.direction(point)
            if point.t == first[0][0] or (slips and not h):
                return False
            slip = point.rate[self.no_slip]
            if not slip @ self._acceleration(point) < 0:
                return False
            if slips and self._is_unresolved(point, h):
                unresolved = nextafter(float(np.linalg.norm(slip)) / CLEAR_SLIP, inf)
                point.system.set_min_slip_speed(max(unresolved, point.system.closure_friction.min_slip_speed))
            return not self.slips(point)

        rate: PointFunction = lambda x: float(self._acceleration(x) @ first[0][1])  # noqa: E731
        ends = vanishes if self._is_planar else None  # planar slip misses zero by the errors of the run
        return Guard("zero velocity", self.name, self.index, value, rate, ends=ends)

    @property
    def _is_planar(self) -> bool:
        return len(self.no_slip) > 1

    def _is_unresolved(self, point: "ModePoint", h: float) -> bool:
        """Return whether steps of size h do not resolve the rotation of the slip, whose rate is friction / (m |v|)."""
        slip, acceleration = point.rate[self.no_slip], self._acceleration(point)
        speed = float(np.linalg.norm(slip))
        transverse = acceleration - slip * (slip @ acceleration) / speed**2
        if not h * np.linalg.norm(transverse) > MAX_ROTATION * speed:
            return False
        active = point.system.closure_friction.active
        active[self.friction_index] = False
        try:
            frictionless = self._acceleration(type(point)(point.system, point.all_rows, point.t, point.y))
        finally:
            active[self.friction_index] = True
        return h * float(np.linalg.norm(acceleration - frictionless)) > STABLE * speed

    def _acceleration(self, point: "ModePoint") -> "Array":
        return np.array([point.acceleration(row) for row in self.no_slip])

    def slips(self, point: "ModePoint") -> bool:
        """Return whether the contact slides."""
        speed = float(np.linalg.norm(point.rate[self.no_slip]))
        if self._is_planar and not point.system.closure_friction.is_resolved(speed):
            return False
        return speed > TRANSVERSE * point.velocity_tolerance(self.no_slip[0])

    def is_at_rest(self, point: "ModePoint", row: int) -> bool:
        return not self.slips(point)

    def direction(self, point: "ModePoint") -> "Array":
        """Return the direction of the slip, or of the impending slip."""
        if self.slips(point):
            slip = point.rate[self.no_slip]
            return slip / np.linalg.norm(slip)
        return point.system.closure_friction.directions[self.friction_index]

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == STICKING:
            ratio = lambda x: self.friction_ratio(x.lam)  # noqa: E731
            return (
                Guard("slip", self.name, self.index, self.margin, needs_multipliers=True, monitored_multiplier=ratio),
            )
        return (self.slip_guard(),) if state == SLIDING else ()

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        if self.slips(point) or (state == STICKING and self.margin(point) < COINCIDENT):
            return ()
        system, before = point.system, point.system.mode
        system.enter(tuple(STICKING if i == self.index else k for i, k in enumerate(before)))
        lam = system.derivative(point.t, point.y)[1]
        system.enter(before)
        if np.linalg.norm(self.friction_ratio(lam)) > 1.0:
            self._set_slip_direction(point, lam)
            return ()
        return tuple(CandidateRow(row) for row in self.no_slip)

    def _set_slip_direction(self, point: "ModePoint", lam: "Array") -> None:
        size = float(np.linalg.norm(lam[self.no_slip]))
        if size:
            point.system.closure_friction.directions[self.friction_index][:] = -lam[self.no_slip] / size

    def next_state(self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool) -> int:
        if active:
            return STICKING
        if point.system.mode[self.index] == STICKING:
            self._set_slip_direction(point, point.lam)
        point.system.closure_friction.directions[self.friction_index][:] = self.direction(point)
        if self._is_planar:
            self._require_tangents(point.system, point.y)
        return SLIDING

    def _require_tangents(self, system: "Index2System", y: "Array") -> None:
        """Check that the tangents at a contact are continuous: slip directions are stored as components along them.

        Raises:
            StepError: if the normal is opposite to the z axis of a sphere.
        """
        system.jacobian(system.split(y)[0])
        pair = system.closure_friction.interfaces[self.friction_index].pair
        if np.linalg.norm(system.constraints.W[:3, self.normal] + pair.Ra[:, 2]) <= PARALLEL:
            where = "the normal is -z of its first frame, and tangents are undefined: rotate this frame"
            raise StepError("singular", f"{self.name!r} begins to slide where {where}")

    def enter(self, system: "Index2System", state: int) -> None:
        system.closure_friction.active[self.friction_index] = state == SLIDING
