"""Closures that are active in a joint range."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...errors import InputError
from ...tolerances import SAME_STATE, STILL
from ..closures.active_range import ActiveRange
from ..closures.closure import Closure
from ..frames import find_joint
from .switch import Guard, ImpactRow, Switch

if TYPE_CHECKING:
    from ...system import Array
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

OFF, ON = 0, 1
AHEAD = SAME_STATE  # rad or characteristic lengths: lookahead of a joint at the boundary of a window


class RangeSwitch(Switch):
    """The rows of a closure are active while a joint is within a window.

    Args:
        name: of the closure.
        spec: the windows.
        rows: indices of the rows.
        columns: indices of the joint in q and in v.
    """

    takes_impulse = False
    states = ("out of its window", "at work")

    def __init__(self, name: str, spec: ActiveRange, rows: Sequence[int], columns: tuple[int, int]) -> None:
        super().__init__(name)
        self.spec, self.all_rows, self.row = spec, tuple(rows), rows[0]
        self.q, self.v = columns

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        out = []
        for c in mechanism.constraints:
            if isinstance(c, Closure) and c.within:
                joint = find_joint(mechanism.model, c.within.joint)
                if (joint.nq, joint.nv) != (1, 1):
                    raise InputError(f"{c.name!r}: joint {c.within.joint!r} of within needs one bounded coordinate")
                out.append(cls(c.name, c.within, mechanism.rows_of(c.name), (joint.idx_q, joint.idx_v)))
        return out

    @property
    def rows(self) -> tuple[int, ...]:
        return self.all_rows

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        """Return whether the joint is within a window, whatever the motion."""
        return ON if self.spec.depth(float(q[self.q])) > 0 else OFF

    def depth(self, point: "ModePoint") -> float:
        """Return the distance inside a window."""
        return self.spec.depth(float(point.q[self.q]))

    def guards(self, state: int) -> tuple[Guard, ...]:
        sign = 1.0 if state == ON else -1.0
        return (Guard("pass", self.name, self.at, lambda x: sign * self.depth(x), loads=True, longest=self.longest),)

    def _scale(self, point: "ModePoint") -> float:
        return float(point.system.mechanism.coordinate_scales[self.v])

    def longest(self, point: "ModePoint") -> float:
        """Return the time in which the joint crosses the shortest window."""
        return self.spec.shortest / max(abs(float(point.v[self.v])), STILL * point.speed * self._scale(point))

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        there = self.next_state(point, (), (), False) == ON
        return tuple(ImpactRow(row, 0.0) for row in self.all_rows) if there else ()

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool
    ) -> int:
        v = float(point.v[self.v])
        step = AHEAD * self._scale(point) * ((v > 0) - (v < 0))
        return ON if self.spec.depth(float(point.q[self.q]) + step) > 0 else OFF
