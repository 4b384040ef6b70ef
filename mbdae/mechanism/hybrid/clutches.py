"""One-way clutches, which lock against backward rotation, and ratchets, which lock at their teeth."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...tolerances import COINCIDENT
from ..closures.clutch import Clutch
from ..frames import find_joint
from .switch import Guard, ImpactRow, LoadCandidate, Margins, Switch, UnilateralRow, Value

if TYPE_CHECKING:
    from ...system import Array
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

FREE, LOCKED, BACK = 0, 1, 2


class OneWayClutch(UnilateralRow):
    """One-way clutch: sign (G v) >= 0, sign lam >= 0, complementary.

    Args:
        spec: the clutch.
        row: index of its row.
    """

    states: tuple[str, ...] = ("runs free", "locks")

    def __init__(self, spec: Clutch, row: int) -> None:
        super().__init__(spec.name, row, float(spec.direction))

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        alone, _ = _one_way(mechanism)
        return [cls(c, mechanism.rows_of(c.name)[0]) for c in alone]

    def margins(self, motion: Margins) -> "tuple[Array, Array | None]":
        speed = self.sign * motion.rate[:, self.row]
        ahead = np.append(0.0, np.cumsum(np.diff(motion.x) * (speed[1:] + speed[:-1]) / 2))
        return ahead - np.maximum.accumulate(ahead), None

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state == LOCKED:
            return (Guard("let go", self.name, self.at, self.load, loads=True, load=self.load),)
        return (Guard("rest", self.name, self.at, self.speed, self.acceleration),)

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, self.sign),)

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        return (LoadCandidate.unilateral(self.row, self.sign),)


class OpposedClutches(Switch):
    """One of two opposed one-way clutches, which together lock both ways under any load.

    Each has a multiplier, half of the torque.

    Args:
        spec: the clutch.
        row: index of its row.
    """

    states = ("idle", "locks both ways")

    def __init__(self, spec: Clutch, row: int) -> None:
        super().__init__(spec.name)
        self.row = row

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        _, opposed = _one_way(mechanism)
        return [cls(c, mechanism.rows_of(c.name)[0]) for c in opposed]

    def guards(self, state: int) -> tuple[Guard, ...]:
        return ()

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, 0.0),)

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool
    ) -> int:
        return LOCKED


class Ratchet(OneWayClutch):
    """A clutch with teeth: it runs free forwards, and backwards to the last tooth.

    Args:
        spec: the clutch.
        row: index of its row.
        columns: of both coordinates in q; without the second one against the ground.
    """

    states = ("runs free", "locks", "runs back")

    def __init__(self, spec: Clutch, row: int, columns: Sequence[int]) -> None:
        super().__init__(spec, row)
        self.pitch, self.tooth, self.columns = float(spec.pitch or 1.0), spec.tooth, list(columns)
        self.shares = np.array([1.0, -1.0 if spec.ratio is None else -spec.ratio])[: len(columns)]

    @classmethod
    def of(cls, mechanism: "Mechanism") -> Sequence[Switch]:
        return [
            cls(c, mechanism.rows_of(c.name)[0], [find_joint(mechanism.model, n).idx_q for n in c.between])
            for c in mechanism.constraints
            if isinstance(c, Clutch) and c.pitch is not None
        ]

    def in_pitches(self, point: "ModePoint") -> float:
        """Return its position in pitches."""
        return self.sign * (float(self.shares @ point.q[self.columns]) - self.tooth) / self.pitch

    def margins(self, motion: Margins) -> "tuple[Array, Array | None]":
        place = self.sign * (motion.q[:, self.columns] @ self.shares - self.tooth) / self.pitch
        return (place - np.floor(np.maximum.accumulate(place) + COINCIDENT)) * self.pitch, None

    def gap(self) -> Value:
        """Return the distance back to the last tooth, fixed at the first evaluation."""
        last: list[float] = []

        def value(point: "ModePoint") -> float:
            place = self.in_pitches(point)
            if not last:
                last.append(np.floor(place + COINCIDENT))
            return (place - last[0]) * self.pitch

        return value

    def guards(self, state: int) -> tuple[Guard, ...]:
        if state != BACK:
            return super().guards(state)
        turns = Guard("rest", self.name, self.at, lambda x: -self.speed(x), lambda x: -self.acceleration(x))
        return (Guard("touch", self.name, self.at, self.gap(), self.speed), turns)

    def _in_tooth(self, point: "ModePoint") -> bool:
        place = self.in_pitches(point)
        return abs(place - round(place)) < COINCIDENT

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        return (ImpactRow(self.row, self.sign),) if state == LOCKED or self._in_tooth(point) else ()

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        return super().load_candidates(point, state, near) if state == LOCKED or self._in_tooth(point) else ()

    def next_state(
        self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool
    ) -> int:
        if held:
            return LOCKED
        speed = self.speed(point)
        if abs(speed) > point.velocity_tolerance(self.rows[0]):  # if slower, its acceleration decides
            return FREE if speed > 0 else BACK
        if len(rates) or point.system.mode[self.at] == LOCKED:
            return FREE
        return FREE if self.acceleration(point) >= 0 else BACK


def _one_way(mechanism: "Mechanism") -> tuple[list[Clutch], list[Clutch]]:
    """Return the one-way clutches without an opposed one between the same joints, and those with one."""
    clutches = [c for c in mechanism.clutches if c.pitch is None and c.engaged is None]
    found = [_free_direction(c) for c in clutches]
    opposed = [any(k == key and way * other < 0 for k, other in found) for key, way in found]
    pairs = list(zip(clutches, opposed, strict=True))
    return [c for c, yes in pairs if not yes], [c for c, yes in pairs if yes]


def _free_direction(c: Clutch) -> tuple[tuple[str, str, float], float]:
    """Return the free velocity v_i - ratio v_j of a clutch, joints in alphabetical order, and its direction."""
    i, j = c.joints or (c.joint or "", "")
    ratio = 1.0 if c.ratio is None else c.ratio
    if not j or i < j or not ratio:
        return (i, j, float(f"{ratio:.12g}")), float(c.direction)
    return (j, i, float(f"{1 / ratio:.12g}")), -c.direction * np.sign(ratio)
