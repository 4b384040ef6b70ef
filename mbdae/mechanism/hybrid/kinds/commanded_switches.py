"""Switches at known times: commanded clutches, and drivers with speed steps.

Both cause impacts at the end of a step, subject to all other closures; see `mbdae.mechanism.hybrid.impact_law`.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...closures.clutch import Clutch
from ...closures.driver import Driver
from ...time_functions.time_functions import Steps
from ..switch import Guard, ImpactRow, Switch

if TYPE_CHECKING:
    from ....system import Array
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

OPEN, ENGAGED = 0, 1


class CommandedClutch(Switch):
    """A clutch that locks in both directions while its signal is above 0.

    Args:
        spec: the clutch.
        row: index of its row.
    """

    states = ("open", "engaged")

    def __init__(self, spec: Clutch, row: int) -> None:
        super().__init__(spec.name)
        self.spec, self.row = spec, row

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        found = [c for c in mechanism.constraints if isinstance(c, Clutch) and c.engaged]
        return [cls(c, mechanism.rows_of(c.name)[0]) for c in found]

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        """Return the commanded state, which is independent of the motion."""
        return ENGAGED if self.spec.engaged and self.spec.engaged.at(t) > 0 else OPEN

    def commanded_state(self, point: "ModePoint") -> int:
        """Return the commanded state at a point."""
        return self.prescribed(point.t, point.q, point.v)

    def guards(self, state: int) -> tuple[Guard, ...]:
        return (Guard("command", self.name, self.index, lambda x: 1.0 if self.commanded_state(x) == state else -1.0),)

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, 0.0),) if self.commanded_state(point) == ENGAGED else ()

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool
    ) -> int:
        return self.commanded_state(point)


class SpeedStepDriver(Switch):
    """A driver with speed steps: its row is always active, and takes part in an impact at each step.

    Args:
        spec: the driver.
        row: index of its row.
    """

    states = ("driven",)

    def __init__(self, spec: Driver, row: int) -> None:
        super().__init__(spec.name)
        self.row = row

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        found = [d for d in mechanism.drivers if isinstance(d.speed, Steps)]
        return [cls(d, mechanism.rows_of(d.name)[0]) for d in found]

    @property
    def rows(self) -> tuple[int, ...]:
        return ()  # its row is active in all modes

    def _margin(self, point: "ModePoint") -> float:
        return point.velocity_tolerance(self.row) - abs(float(point.rate[self.row]))

    def guards(self, state: int) -> tuple[Guard, ...]:
        return (Guard("speed step", self.name, self.index, self._margin),)
