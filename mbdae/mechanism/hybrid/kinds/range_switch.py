"""Closures that are active within ranges of a joint coordinate."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ....errors import InputError
from ....tolerances import SAME_STATE, ZERO_SPEED
from ...closures.active_range import ActiveRange
from ...closures.closure import Closure
from ...tree.frames import find_joint
from ..switch import Guard, ImpactRow, PiecesFunction, PointFunction, Switch, core_switch

if TYPE_CHECKING:
    from ....data_types import CoreData
    from ....system import Array
    from ...formulations.index2 import Index2System
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

OUTSIDE, INSIDE = 0, 1
LOOKAHEAD = SAME_STATE  # rad or characteristic lengths: displacement that decides the state at a range boundary


class RangeSwitch(Switch):
    """A closure whose rows are active while a joint coordinate is within a range.

    Args:
        name: name of the closure.
        spec: the ranges.
        rows: indices of the rows.
        columns: indices of the joint in q and in v.
    """

    by_position, takes_impulse = True, False
    states = ("out of range", "active")

    def __init__(self, name: str, spec: ActiveRange, rows: Sequence[int], columns: tuple[int, int]) -> None:
        super().__init__(name)
        self.spec, self.all_rows, self.row = spec, tuple(rows), rows[0]
        self.q, self.v = columns

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
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
        """Return the state at q, which depends only on the joint coordinate."""
        return INSIDE if self.spec.depth(float(q[self.q])) > 0 else OUTSIDE

    def depth(self, point: "ModePoint") -> float:
        """Return the distance from the boundary of the range, positive inside."""
        return self.spec.depth(float(point.q[self.q]))

    def guards(self, state: int) -> tuple[Guard, ...]:
        sign = 1.0 if state == INSIDE else -1.0
        depth: PointFunction = lambda x: sign * self.depth(x)  # noqa: E731
        pieces: PiecesFunction = lambda x: [sign * d for d in self.spec.distances(float(x.q[self.q]))]  # noqa: E731
        boundary = Guard("range boundary", self.name, self.index, depth, needs_multipliers=True, max_step=self.max_step)
        return (boundary._replace(pieces=pieces),)

    def _scale(self, point: "ModePoint") -> float:
        return float(point.system.mechanism.coordinate_scales[self.v])

    def max_step(self, point: "ModePoint") -> float:
        """Return the time in which the joint passes the shortest range."""
        return self.spec.shortest / max(abs(float(point.v[self.v])), ZERO_SPEED * point.speed * self._scale(point))

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        inside = self.next_state(point, (), (), False) == INSIDE
        return tuple(ImpactRow(row, 0.0) for row in self.all_rows) if inside else ()

    def next_state(self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool) -> int:
        v = float(point.v[self.v])
        step = LOOKAHEAD * self._scale(point) * ((v > 0) - (v < 0))
        return INSIDE if self.spec.depth(float(point.q[self.q]) + step) > 0 else OUTSIDE

    def core_data(self, system: "Index2System") -> "CoreData":
        within = self.spec
        windows = {"windows": list(within.windows), "period": within.period or 0.0, "shortest": within.shortest}
        return core_switch(self, "range", positions=[self.q], factors=[1.0], column=self.v, **windows)
