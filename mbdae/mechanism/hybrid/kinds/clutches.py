"""One-way clutches, which lock against backward motion, and ratchets, which lock at their teeth."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ....tolerances import COINCIDENT
from ...closures.clutch import Clutch
from ...tree.frames import find_joint
from ..switch import CandidateRow, Guard, ImpactRow, PointFunction, SampledMotion, Switch, UnilateralRow, core_switch

if TYPE_CHECKING:
    from ....data_types import CoreData
    from ....system import Array
    from ...formulations.index2 import Index2System
    from ...mechanism import Mechanism
    from ..mode_point import ModePoint

FREE, LOCKED, BACKWARDS = 0, 1, 2


class OneWayClutch(UnilateralRow):
    """One-way clutch: sign (G v) >= 0, sign lam >= 0, complementary.

    Args:
        spec: the clutch.
        row: index of its row.
    """

    states: tuple[str, ...] = ("free-running", "locked")

    def __init__(self, spec: Clutch, row: int) -> None:
        super().__init__(spec.name, row, float(spec.direction))

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        single, _ = _single_and_opposed(mechanism)
        return [cls(c, mechanism.rows_of(c.name)[0]) for c in single]

    def margins(self, motion: SampledMotion) -> "tuple[Array, Array | None]":
        speed = self.sign * motion.rate[:, self.row]
        position = np.append(0.0, np.cumsum(np.diff(motion.x) * (speed[1:] + speed[:-1]) / 2))
        return position - np.maximum.accumulate(position), None

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == LOCKED:
            return (self.separation_guard(),)
        return (Guard("zero velocity", self.name, self.index, self.speed, self.acceleration),)

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, self.sign),)

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        return (CandidateRow.unilateral(self.row, self.sign),)

    def core_data(self, system: "Index2System") -> "CoreData":
        return core_switch(self, "clutch", sign=self.sign)


class OpposedClutches(Switch):
    """One of two opposed one-way clutches, which together lock in both directions under any load.

    The multiplier of each is half of the torque.

    Args:
        spec: the clutch.
        row: index of its row.
    """

    states = ("idle", "locked both ways")

    def __init__(self, spec: Clutch, row: int) -> None:
        super().__init__(spec.name)
        self.row = row

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        _, opposed = _single_and_opposed(mechanism)
        return [cls(c, mechanism.rows_of(c.name)[0]) for c in opposed]

    def guards(self, state: int) -> tuple[Guard, ...]:
        return ()

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, 0.0),)

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool
    ) -> int:
        return LOCKED


class Ratchet(OneWayClutch):
    """A one-way clutch with teeth: free to run forwards, and backwards to the last tooth.

    Args:
        spec: the clutch.
        row: index of its row.
        columns: indices of both coordinates in q, or of one coordinate relative to the ground.
    """

    states = ("free-running", "locked", "running backwards")

    def __init__(self, spec: Clutch, row: int, columns: Sequence[int]) -> None:
        super().__init__(spec, row)
        self.pitch, self.tooth, self.columns = float(spec.pitch or 1.0), spec.tooth, list(columns)
        self.coefficients = np.array([1.0, -1.0 if spec.ratio is None else -spec.ratio])[: len(columns)]

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        return [
            cls(c, mechanism.rows_of(c.name)[0], [find_joint(mechanism.model, n).idx_q for n in c.between])
            for c in mechanism.constraints
            if isinstance(c, Clutch) and c.pitch is not None
        ]

    def position_in_pitches(self, point: "ModePoint") -> float:
        """Return the position in pitches."""
        return self.sign * (float(self.coefficients @ point.q[self.columns]) - self.tooth) / self.pitch

    def margins(self, motion: SampledMotion) -> "tuple[Array, Array | None]":
        position = self.sign * (motion.q[:, self.columns] @ self.coefficients - self.tooth) / self.pitch
        return (position - np.floor(np.maximum.accumulate(position) + COINCIDENT)) * self.pitch, None

    def gap(self) -> PointFunction:
        """Return the distance back to the last tooth, fixed at the first evaluation."""
        last: list[float] = []

        def value(point: "ModePoint") -> float:
            position = self.position_in_pitches(point)
            if not last:
                last.append(np.floor(position + COINCIDENT))
            return (position - last[0]) * self.pitch

        return value

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state != BACKWARDS:
            return super().guards(state)
        speed: PointFunction = lambda x: -self.speed(x)  # noqa: E731
        acceleration: PointFunction = lambda x: -self.acceleration(x)  # noqa: E731
        return (
            Guard("contact", self.name, self.index, self.gap(), self.speed),
            Guard("zero velocity", self.name, self.index, speed, acceleration),
        )

    def core_data(self, system: "Index2System") -> "CoreData":
        teeth = {"pitch": self.pitch, "tooth": self.tooth, "factors": self.coefficients.tolist()}
        return core_switch(self, "ratchet", sign=self.sign, positions=list(self.columns), **teeth)

    def _is_at_tooth(self, point: "ModePoint") -> bool:
        position = self.position_in_pitches(point)
        return abs(position - round(position)) < COINCIDENT

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, self.sign),) if state == LOCKED or self._is_at_tooth(point) else ()

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        return super().candidate_rows(point, state, tolerance) if state == LOCKED or self._is_at_tooth(point) else ()

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool
    ) -> int:
        if active:
            return LOCKED
        speed = self.speed(point)
        if abs(speed) > point.velocity_tolerance(self.rows[0]):  # otherwise the acceleration decides
            return FREE if speed > 0 else BACKWARDS
        if len(rates) or point.system.mode[self.index] == LOCKED:
            return FREE
        return FREE if self.acceleration(point) >= 0 else BACKWARDS


def _single_and_opposed(mechanism: "Mechanism") -> tuple[list[Clutch], list[Clutch]]:
    """Return the one-way clutches without, and with, an opposed one-way clutch between the same joints."""
    clutches = [c for c in mechanism.clutches if c.pitch is None and c.engaged is None]
    found = [_free_direction(c) for c in clutches]
    opposed = [any(k == key and direction * other < 0 for k, other in found) for key, direction in found]
    pairs = list(zip(clutches, opposed, strict=True))
    return [c for c, is_opposed in pairs if not is_opposed], [c for c, is_opposed in pairs if is_opposed]


def _free_direction(c: Clutch) -> tuple[tuple[str, str, float], float]:
    """Return the free velocity v_i - ratio v_j of a clutch, joints in alphabetical order, and its direction."""
    i, j = c.joints or (c.joint or "", "")
    ratio = 1.0 if c.ratio is None else c.ratio
    if not j or i < j or not ratio:
        return (i, j, float(f"{ratio:.12g}")), float(c.direction)
    return (j, i, float(f"{1 / ratio:.12g}")), -c.direction * np.sign(ratio)
