"""Base class of all kinds of switches."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from ...system import Array
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism
    from .mode_point import ModePoint

Value = Callable[["ModePoint"], float]
Load = Callable[["ModePoint"], "float | Array"]
ACTIVE_STATE = 1  # state in which closed, locked, engaged or stuck rows are active


class Guard(NamedTuple):
    """A guard: a function of the point that is positive while a state lasts.

    Attributes:
        kind: ``"touch"``, ``"let go"``, ``"slip"``, ``"rest"``, ``"pass"``, ``"command"`` or ``"step"``.
        name: of the switch.
        at: its index.
        value: the function.
        rate: its time derivative, if known: used to detect an excursion below 0 and back within a step.
        bend: its second time derivative.
        loads: whether it depends on multipliers, and is sampled within steps.
        longest: the longest step in s that cannot cross it twice.
        load: the multipliers that it depends on and that steps should resolve: signed, relative to the limit, for
            sticking; the multiplier itself for a row that separates at 0.
    """

    kind: str
    name: str
    at: int
    value: Value
    rate: Value | None = None
    bend: Value | None = None
    loads: bool = False
    load: "Load | None" = None
    longest: Value | None = None


class ImpactRow(NamedTuple):
    """A row that takes part in an impact.

    Attributes:
        row: its index.
        sign: 1 or -1: sign * (G v + g_t) is the opening speed; 0 for a kept row.
        restitution: coefficient of restitution.
        share: mu, of a tangential row limited by the impulse of the switch's first row; nan for others.
    """

    row: int
    sign: float
    restitution: float = 0.0
    share: float = np.nan


class LoadCandidate(NamedTuple):
    """A row that may carry load.

    Attributes:
        row: its index.
        lower: lower bound of the multiplier.
        upper: upper bound of the multiplier.
        share: mu, of a tangential row limited by the switch's first row, see `friction_lcp.FrictionBound`; nan for
            others.
        drag: friction coefficient of a sliding row, with sign.
    """

    row: int
    lower: float = -np.inf
    upper: float = np.inf
    share: float = np.nan
    drag: float = np.nan

    @classmethod
    def unilateral(cls, row: int, sign: float) -> "LoadCandidate":
        """Return a candidate whose multiplier has a sign, 1 or -1."""
        return cls(row, lower=0.0) if sign > 0 else cls(row, upper=0.0)

    @property
    def one_sided(self) -> bool:
        """Whether its multiplier has a sign."""
        return bool(np.isfinite(self.lower) != np.isfinite(self.upper))

    @property
    def slips(self) -> bool:
        """Whether it yields at both bounds."""
        return bool(np.isfinite(self.upper - self.lower))


class Margins(NamedTuple):
    """Motion over x, time or arclength, to be checked by switches that do not act on it.

    Attributes:
        x: ascending, (n,).
        q: configurations, (n, nq).
        g: of all rows in any mode, (n, ng).
        rate: G dq/dx, (n, ng).
    """

    x: "Array"
    q: "Array"
    g: "Array"
    rate: "Array"


class Switch:
    """Base of elements that switch between a few states.

    Attributes:
        name: of the stop, closure or joint.
        at: its index among the switches of the mechanism.
        states: names of its states.
        rest: duration in s below which a flight ends in rest.
        row: index of its first row.
        takes_impulse: whether impulses act through that row, and only that row.
    """

    row: int
    takes_impulse = True
    states: tuple[str, ...] = ("open", "closed")
    rest: float = 0.0

    def __init__(self, name: str) -> None:
        self.name, self.at = name, -1

    @classmethod
    def of(cls, mechanism: "Mechanism") -> "Sequence[Switch]":
        """Return the switches of this kind that a mechanism has."""
        return ()

    @property
    def rows(self) -> tuple[int, ...]:
        """All its rows; `row` alone by default."""
        return (self.row,)

    def active(self, state: int) -> tuple[int, ...]:
        """Return the active rows of a state; by default, all of them in state 1."""
        return self.rows if state == ACTIVE_STATE else ()

    def guards(self, state: int) -> tuple[Guard, ...]:
        """Return the guards of a state."""
        raise NotImplementedError

    def impact_rows(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        """Return rows that take part in an impact at a point: active contacts, within ``near``."""
        return ()

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        """Return rows that may carry load after an event; the first one decides for the others."""
        return ()

    def next_state(self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool) -> int:
        """Return the state after an event.

        Args:
            point: the point.
            lam: multipliers of the candidates; empty without candidates.
            rates: accelerations G v' + gamma of the candidates.
            held: whether the multiplier of the first lies within its box.
        """
        return int(held)

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        """Return the state in a prescribed motion, where unilateral rows carry no load.

        Args:
            t: time.
            q: configuration, (nq,).
            v: velocity, (nv,).
        """
        return 0

    def margins(self, motion: "Margins") -> "tuple[Array, Array | None] | None":
        """Return the distance of a motion from the limit of the switch, negative beyond it, (n,), and its rate.

        None without a limit.
        """
        return None

    def enter(self, system: "Index2System", state: int) -> None:
        """Set further properties of a workspace that depend on the state."""


class UnilateralRow(Switch):
    """Switch of a unilateral row: sign (G v + g_t) may grow, sign lam >= 0.

    Args:
        name: of the switch.
        row: index of the row.
        sign: 1 or -1.
    """

    def __init__(self, name: str, row: int, sign: float) -> None:
        super().__init__(name)
        self.row, self.sign = row, sign

    def speed(self, point: "ModePoint") -> float:
        """Return its opening or overrunning speed."""
        return self.sign * float(point.rate[self.row])

    def acceleration(self, point: "ModePoint") -> float:
        """Return the time derivative of `speed`."""
        return self.sign * point.acceleration(self.row)

    def load(self, point: "ModePoint") -> float:
        """Return the normal force, or the transmitted torque; positive under load."""
        return self.sign * float(point.lam[self.row])
