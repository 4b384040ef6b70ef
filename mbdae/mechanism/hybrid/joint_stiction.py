"""Joints with dry friction: sticking, or slipping forwards or backwards."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...tolerances import COINCIDENT, VISIBLE
from ..closures.brake import Brake
from ..forces.joint_friction import KineticFrictionElement
from ..frames import find_joint
from .friction_utilisation import friction_utilisation
from .switch import Guard, LoadCandidate, Switch

if TYPE_CHECKING:
    from ...system import Array
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

IDLE, STUCK, AHEAD, BACK = 0, 1, 2, 3


class JointStiction(Switch):
    """A joint with dry friction, |lam| <= static while it sticks, tau = -kinetic * sign(v) while it slips.

    Args:
        spec: its row and its friction.
        row: index of the row.
        column: of its velocity.
    """

    takes_impulse = False
    states = ("idle", "sticks", "slips ahead", "slips back")

    def __init__(self, spec: Brake, row: int, column: int) -> None:
        super().__init__(spec.name)
        self.spec, self.row, self.column = spec, row, column
        self.others: tuple[JointStiction, ...] = ()  # all of the mechanism

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        brakes = [c for c in mechanism.constraints if isinstance(c, Brake)]
        out = tuple(cls(c, mechanism.rows_of(c.name)[0], find_joint(mechanism.model, c.joint).idx_v) for c in brakes)
        for switch in out:
            switch.others = out
        return out

    def margin(self, point: "ModePoint") -> float:
        """Return the remaining friction as a fraction of its limit."""
        mode = point.system.mode
        return 1.0 - friction_utilisation(
            point, self.row, {s.row: s.spec.static for s in self.others if mode[s.at] == STUCK}
        )

    def load(self, point: "ModePoint") -> float:
        """Return the multiplier as a fraction of the limit."""
        return float(point.lam[self.row]) / self.spec.static

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == STUCK:
            return (Guard("slip", self.name, self.at, self.margin, loads=True, load=self.load),)
        if state in (AHEAD, BACK):
            sign = 1.0 if state == AHEAD else -1.0
            return (
                Guard(
                    "rest",
                    self.name,
                    self.at,
                    lambda x: sign * float(x.v[self.column]),
                    lambda x: sign * float(x.vdot[self.column]),
                ),
            )
        return ()

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        limit = self.spec.static
        if state == STUCK and self.margin(point) < COINCIDENT:
            limit = min(self.spec.kinetic, (1.0 - VISIBLE) * limit)
        return (LoadCandidate(self.row, -limit, limit),)

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        return AHEAD if v[self.column] > 0 else BACK if v[self.column] < 0 else IDLE

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool
    ) -> int:
        if held:
            return STUCK
        return AHEAD if (rates[0] if len(rates) else point.v[self.column]) > 0 else BACK

    def enter(self, system: "Index2System", state: int) -> None:
        system.sticks |= state == STUCK
        for law, _ in system.laws.bound:
            if isinstance(law, KineticFrictionElement) and law.name == self.spec.force:
                law.sign[self.column] = {AHEAD: 1.0, BACK: -1.0}.get(state, 0.0)
