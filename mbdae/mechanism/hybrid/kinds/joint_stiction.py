"""Joints with Coulomb friction: sticking, or slipping forwards or backwards."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ....tolerances import COINCIDENT, VISIBLE
from ...closures.brake import Brake
from ...forces.joint_friction import KineticFrictionElement
from ...tree.frames import find_joint
from ..friction_utilization import friction_utilization
from ..switch import CandidateRow, Guard, Switch, core_switch

if TYPE_CHECKING:
    from ....data_types import CoreData
    from ....system import Array
    from ...formulations.index2 import Index2System
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

IDLE, STICKING, FORWARDS, BACKWARDS = 0, 1, 2, 3
SIGN = {FORWARDS: 1.0, BACKWARDS: -1.0}  # sign of the velocity


class JointStiction(Switch):
    """A joint with Coulomb friction, |lam| <= static while it sticks, tau = -kinetic * sign(v) while it slips.

    Args:
        spec: the row of the joint and its friction.
        row: index of the row.
        column: index of the velocity.
    """

    takes_impulse = False
    states = ("idle", "sticking", "slipping forwards", "slipping backwards")

    def __init__(self, spec: Brake, row: int, column: int) -> None:
        super().__init__(spec.name)
        self.spec, self.row, self.column = spec, row, column
        self.all_joints: tuple[JointStiction, ...] = ()  # all switches of this kind in the mechanism

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        brakes = [c for c in mechanism.constraints if isinstance(c, Brake)]
        out = tuple(cls(c, mechanism.rows_of(c.name)[0], find_joint(mechanism.model, c.joint).idx_v) for c in brakes)
        for switch in out:
            switch.all_joints = out
        return out

    def margin(self, point: "ModePoint") -> float:
        """Return the stiction margin as a fraction of the limit."""
        mode = point.system.mode
        return 1.0 - friction_utilization(
            point, self.row, {s.row: s.spec.static for s in self.all_joints if mode[s.index] == STICKING}
        )

    def signed_utilization(self, point: "ModePoint") -> float:
        """Return lam / static: the signed utilization of the limit, unless the row is redundant (see `margin`)."""
        return float(point.lam[self.row]) / self.spec.static

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == STICKING:
            ratio = self.signed_utilization
            return (
                Guard(
                    "slip", self.name, self.index, self.margin, needs_multipliers=True, monitored_multiplier=ratio
                ),
            )
        if sign := SIGN.get(state):
            return (
                Guard(
                    "zero velocity",
                    self.name,
                    self.index,
                    lambda x: sign * float(x.v[self.column]),
                    lambda x: sign * float(x.vdot[self.column]),
                ),
            )
        return ()

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        limit = self.spec.static
        if state == STICKING and self.margin(point) < COINCIDENT:
            limit = min(self.spec.kinetic, (1.0 - VISIBLE) * limit)
        return (CandidateRow(self.row, -limit, limit),)

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        return FORWARDS if v[self.column] > 0 else BACKWARDS if v[self.column] < 0 else IDLE

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool
    ) -> int:
        if active:
            return STICKING
        return FORWARDS if (rates[0] if len(rates) else point.v[self.column]) > 0 else BACKWARDS

    def enter(self, system: "Index2System", state: int) -> None:
        system.has_sticking_joints |= state == STICKING
        for law, _ in system.laws.bound:
            if isinstance(law, KineticFrictionElement) and law.name == self.spec.force:
                law.sign[self.column] = SIGN.get(state, 0.0)

    def slip_friction(self, state: int) -> float:
        return -self.spec.kinetic * SIGN.get(state, 0.0)

    def core_data(self, system: "Index2System") -> "CoreData":
        laws = [law for law, _ in system.laws.acting]
        law = next(k for k, x in enumerate(laws) if isinstance(x, KineticFrictionElement) and x.name == self.spec.force)
        limits = {"friction": self.spec.kinetic, "limit": self.spec.static}
        return core_switch(self, "stiction", **limits, law=law, column=self.column)
