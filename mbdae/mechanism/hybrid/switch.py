"""Base class of all kinds of switches."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ...data_types import CoreData
    from ...system import Array
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

PointFunction = Callable[["ModePoint"], float]
PiecesFunction = Callable[["ModePoint"], Sequence[float]]
MultiplierFunction = Callable[["ModePoint"], "float | Array"]
COMMANDS = ("command", "speed step")  # kinds of guards that jump, at known times
ACTIVE_STATE = 1  # state in which closed, locked, engaged or sticking rows are active


class Guard(NamedTuple):
    """A guard: a function of the point that is positive during a state.

    Attributes:
        kind: ``"contact"``, ``"separation"``, ``"slip"``, ``"zero velocity"``, ``"range boundary"``, ``"command"`` or
            ``"speed step"``.
        name: name of the switch.
        switch: index of the switch.
        value: the function.
        rate: time derivative of the guard, if known, to detect an excursion below 0 and back within a step.
        second_rate: second time derivative of the guard.
        needs_multipliers: whether the guard depends on multipliers, and is sampled within steps.
        monitored_multiplier: the multiplier that steps must resolve: for ``"slip"``, over its limit and with sign, so
            that the row slips where the norm exceeds 1, (m,) for m no-slip rows; for ``"separation"``, the multiplier
            itself, positive while the row is active. None: the guard does not depend on the multiplier of its row.
        max_step: the longest step in s in which the guard cannot cross zero twice.
        pieces: smooth functions that make up a guard with kinks.
        ends: function of the point and the fixed step size in s, 0 with step-size control: whether the state ends at
            the start of a step although errors hide the zero of the guard; None: never.
    """

    kind: str
    name: str
    switch: int
    value: PointFunction
    rate: PointFunction | None = None
    second_rate: PointFunction | None = None
    needs_multipliers: bool = False
    monitored_multiplier: "MultiplierFunction | None" = None
    max_step: PointFunction | None = None
    pieces: PiecesFunction | None = None
    ends: Callable[["ModePoint", float], bool] | None = None


class ImpactRow(NamedTuple):
    """A row that takes part in an impact.

    Attributes:
        row: index of the row.
        sign: 1 or -1: sign * (G v + g_t) is the opening speed; 0 for a bilateral row.
        restitution: coefficient of restitution.
        friction: mu of a tangential row, bounded by the impulse of the first row of its switch; nan for other rows.
    """

    row: int
    sign: float
    restitution: float = 0.0
    friction: float = np.nan


class CandidateRow(NamedTuple):
    """A row that may become active after an event, and the bounds of its multiplier.

    Attributes:
        row: index of the row.
        lower: lower bound of the multiplier.
        upper: upper bound of the multiplier.
        friction: mu of a tangential row, bounded by the first row of its switch (`friction_lcp.FrictionBound`); nan
            for other rows.
        sliding_ratio: friction coefficient of a sliding row, with sign.
    """

    row: int
    lower: float = -np.inf
    upper: float = np.inf
    friction: float = np.nan
    sliding_ratio: float = np.nan

    @classmethod
    def unilateral(cls, row: int, sign: float) -> "CandidateRow":
        """Return a candidate whose multiplier has a sign, 1 or -1."""
        return cls(row, lower=0.0) if sign > 0 else cls(row, upper=0.0)

    @property
    def is_unilateral(self) -> bool:
        """Whether the multiplier has one finite bound."""
        return bool(np.isfinite(self.lower) != np.isfinite(self.upper))

    @property
    def is_bounded(self) -> bool:
        """Whether the multiplier has two finite bounds, beyond which the row slips."""
        return bool(np.isfinite(self.upper - self.lower))


class SampledMotion(NamedTuple):
    """A given motion over time or arclength x, which switches check against their limits.

    Attributes:
        x: time or arclength, ascending, (n,).
        q: configurations, (n, nq).
        g: g of all rows in any mode, (n, ng).
        rate: G dq/dx, (n, ng).
    """

    x: "Array"
    q: "Array"
    g: "Array"
    rate: "Array"


class Switch:
    """Base of elements that switch between a few states.

    Attributes:
        name: name of the stop, closure or joint.
        index: position among the switches of the mechanism.
        states: names of the states.
        rest: flight time in s below which the contact remains closed.
        restitution: coefficient of restitution.
        row: index of the first row.
        by_position: whether `prescribed` depends on q alone: rows that are active at a start are then assembled.
        takes_impulse: whether impulses act through the first row, and only through it.
    """

    row: int
    by_position = False
    takes_impulse = True
    states: tuple[str, ...] = ("open", "closed")
    rest: float = 0.0
    restitution: float = 0.0

    def __init__(self, name: str) -> None:
        self.name, self.index = name, -1

    @classmethod
    def from_mechanism(cls, mechanism: "Mechanism") -> "Sequence[Switch]":
        """Return all switches of this kind of a mechanism."""
        return ()

    @property
    def rows(self) -> tuple[int, ...]:
        """Indices of all rows; only `row` by default."""
        return (self.row,)

    def active_rows(self, state: int) -> tuple[int, ...]:
        """Return the active rows of a state; by default, all of them in state 1."""
        return self.rows if state == ACTIVE_STATE else ()

    def guards(self, state: int) -> tuple[Guard, ...]:
        """Return the guards of a state."""
        raise NotImplementedError

    def impact_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[ImpactRow, ...]:
        """Return the rows that take part in an impact at a point: contacts closed to within ``tolerance``."""
        return ()

    def is_at_rest(self, point: "ModePoint", row: int) -> bool:
        """Return whether the velocity of its first candidate row is zero at a point."""
        return point.is_at_rest(row)

    def candidate_rows(self, point: "ModePoint", state: int, tolerance: float) -> tuple[CandidateRow, ...]:
        """Return the rows that may become active after an event; the first one determines the state."""
        return ()

    def next_state(self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], active: bool) -> int:
        """Return the state after an event.

        Args:
            point: the point.
            lam: multipliers of the candidates; empty without candidates.
            rates: accelerations G v' + gamma of the candidates.
            active: whether the multiplier of the first candidate is within its bounds.
        """
        return int(active)

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        """Return the state in a prescribed motion, where multipliers of unilateral rows are zero.

        Args:
            t: time.
            q: configuration, (nq,).
            v: velocity, (nv,).
        """
        return 0

    def margins(self, motion: "SampledMotion") -> "tuple[Array, Array | None] | None":
        """Return the distance of a motion from the limit of the switch, negative beyond it, (n,), and its rate.

        None without a limit.
        """
        return None

    def slip_friction(self, state: int) -> float:
        """Return the friction of a joint that slips in a state, as the multiplier of its inactive row."""
        return 0.0

    def core_data(self, system: "Index2System") -> "CoreData | None":
        """Return the core data of the switch in a workspace; None if the core does not support it."""
        return None

    def enter(self, system: "Index2System", state: int) -> None:
        """Set properties of a workspace other than rows that depend on the state."""


def core_switch(switch: Switch, kind: str, **data: object) -> "CoreData":
    """Return core data of a switch, with defaults for data that its kind does not use: see native/run/switches.hpp."""
    common = {"kind": kind, "rows": list(switch.rows), "restitution": switch.restitution, "rest": switch.rest}
    unused = {"sign": 1.0, "friction": 0.0, "limit": 0.0, "interface": -1, "law": -1, "column": -1}
    positions = {"positions": [], "factors": [], "pitch": 1.0, "tooth": 0.0}
    return {**common, **unused, **positions, "windows": [], "period": 0.0, "shortest": 0.0, **data}


class UnilateralRow(Switch):
    """Switch of a unilateral row: sign (G v + g_t) may grow, sign lam >= 0.

    Args:
        name: name of the switch.
        row: index of the row.
        sign: 1 or -1.
    """

    def __init__(self, name: str, row: int, sign: float) -> None:
        super().__init__(name)
        self.row, self.sign = row, sign

    def speed(self, point: "ModePoint") -> float:
        """Return the opening or overrunning speed."""
        return self.sign * float(point.rate[self.row])

    def acceleration(self, point: "ModePoint") -> float:
        """Return the time derivative of `speed`."""
        return self.sign * point.acceleration(self.row)

    def multiplier(self, point: "ModePoint") -> float:
        """Return sign lam: the normal force of a contact, the torque of a locked clutch; not negative while active."""
        return self.sign * float(point.lam[self.row])

    def separation_guard(self) -> Guard:
        """Return the guard of the active row, which separates when the multiplier becomes negative."""
        lam = self.multiplier
        return Guard("separation", self.name, self.index, lam, needs_multipliers=True, monitored_multiplier=lam)
