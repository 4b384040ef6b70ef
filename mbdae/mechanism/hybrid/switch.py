"""What switches between a few states: the base of all kinds."""

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
ACTIVE_STATE = 1  # the state in which closed, locked, engaged or stuck rows are solved for
AT_LIMIT = 1e-9  # of the limit: a load that is nearer has reached it


class Guard(NamedTuple):
    """A function of the point that is positive while a state lasts.

    Attributes:
        kind: in a word: ``"touch"``, ``"let go"``, ``"slip"``, ``"rest"``, ``"pass"``, ``"command"``, ``"step"``.
        name: of the switch.
        at: its number.
        value: the function.
        rate: its rate, where it is known: then a visit below 0 and back within a step is seen.
        bend: and the rate of that.
        loads: it depends on multipliers, and is sampled within steps.
        longest: the longest step in s that cannot pass it twice.
        load: what it depends on, and steps shall resolve: multipliers as shares of their limit, signed, of what sticks;
            the multiplier itself of what lets go at 0.
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
        row: its number.
        sign: 1 or -1: sign * (G v + g_t) is the speed at which it opens; 0 for a row that is kept.
        restitution: of Newton's law.
        share: mu, of a tangential row whose impulse the first row of the switch limits; nan for others.
    """

    row: int
    sign: float
    restitution: float = 0.0
    share: float = np.nan


class LoadCandidate(NamedTuple):
    """A row that may carry load.

    Attributes:
        row: its number.
        lower: the least multiplier.
        upper: the largest one.
        share: mu, of a tangential row that the first row of the switch limits, see `rubs.Limit`; nan for others.
        drag: of one that slides.
    """

    row: int
    lower: float = -np.inf
    upper: float = np.inf
    share: float = np.nan
    drag: float = np.nan

    @classmethod
    def unilateral(cls, row: int, sign: float) -> "LoadCandidate":
        """A row whose multiplier has a sign, 1 or -1."""
        return cls(row, lower=0.0) if sign > 0 else cls(row, upper=0.0)

    @property
    def one_sided(self) -> bool:
        """Its multiplier has a sign."""
        return bool(np.isfinite(self.lower) != np.isfinite(self.upper))

    @property
    def slips(self) -> bool:
        """It gives way at both ends."""
        return bool(np.isfinite(self.upper - self.lower))


class Margins(NamedTuple):
    """A motion over x, time or arclength, as switches judge it that do not act on it.

    Attributes:
        x: rising, (n,).
        q: configurations, (n, nq).
        g: of all rows whatever the mode, (n, ng).
        rate: G dq/dx, (n, ng).
    """

    x: "Array"
    q: "Array"
    g: "Array"
    rate: "Array"


class Switch:
    """What switches.

    Attributes:
        name: of the stop, closure or joint.
        at: its number among the switches of the mechanism.
        states: words for its states.
        rest: a flight that is shorter ends in rest, in s.
        row: number of its first row.
        struck: whether impulses pass through that row, and it alone.
    """

    row: int
    struck = True
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
        """All its rows; `row` alone, where a kind does not say more."""
        return (self.row,)

    def active(self, state: int) -> tuple[int, ...]:
        """Return the rows that are solved for in a state; all of them in state 1, where a kind does not say more."""
        return self.rows if state == ACTIVE_STATE else ()

    def guards(self, state: int) -> tuple[Guard, ...]:
        """Return what ends a state."""
        raise NotImplementedError

    def strike(self, point: "ModePoint", state: int, near: float) -> tuple[ImpactRow, ...]:
        """Return rows that take part in an impact at a point: those that touch, within ``near``."""
        return ()

    def load_candidates(self, point: "ModePoint", state: int, near: float) -> tuple[LoadCandidate, ...]:
        """Return rows that may carry load behind a point; the first one decides, others go with it."""
        return ()

    def settled(self, point: "ModePoint", lam: Sequence[float], rates: Sequence[float], held: bool) -> int:
        """Return the state behind a point.

        Args:
            point: the point.
            lam: multipliers of the candidates; empty where there were none.
            rates: accelerations G v' + gamma of them.
            held: the multiplier of the first lies within its box.
        """
        return int(held)

    def prescribed(self, t: float, q: "Array", v: "Array") -> int:
        """Return the state in a motion that is prescribed, where nothing that may open carries load.

        Args:
            t: time.
            q: configuration, (nq,).
            v: velocity, (nv,).
        """
        return 0

    def margins(self, motion: "Margins") -> "tuple[Array, Array | None] | None":
        """Return how far a motion stays from what it does not let pass, negative beyond, (n,), and the rate of that.

        None where it lets everything pass, or has no sides.
        """
        return None

    def enter(self, system: "Index2System", state: int) -> None:
        """Set what else depends on the state in a workspace."""


class UnilateralRow(Switch):
    """What switches a row that works on one side: sign (G v + g_t) is free to grow, sign lam >= 0.

    Args:
        name: of the switch.
        row: number of the row.
        sign: 1 or -1.
    """

    def __init__(self, name: str, row: int, sign: float) -> None:
        super().__init__(name)
        self.row, self.sign = row, sign

    def speed(self, point: "ModePoint") -> float:
        """Return how fast it opens, or runs free."""
        return self.sign * float(point.rate[self.row])

    def acceleration(self, point: "ModePoint") -> float:
        """Return the rate of `speed`."""
        return self.sign * point.acceleration(self.row)

    def load(self, point: "ModePoint") -> float:
        """Return the force with which it presses, or the torque that it transmits; positive while it does."""
        return self.sign * float(point.lam[self.row])
