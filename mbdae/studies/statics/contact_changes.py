"""Contacts that close or open along a path of equilibria over a load.

A path is smooth in each mode. Where a gap or a normal force becomes zero, it continues in the mode in which that
contact has closed or opened, in the direction in which the normal force or the gap increases from zero:

    0 <= gap,   0 <= N,   gap N = 0

so the load may reverse there, as at a limit point.
Source: Bjorkman, Path following and critical points for contact problems, Computational Mechanics 10 (1992).
"""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from ...mechanism.equilibrium.equilibrium_equations import Statics
from .path_point import PathPoint

if TYPE_CHECKING:
    from .contacts import Contacts

Locate = Callable[[PathPoint, float, Callable[[PathPoint], float]], tuple[float, PathPoint]]


class Change(NamedTuple):
    """A contact that changes in a step of a path.

    Attributes:
        h: step length up to the change.
        point: point at which the contact changes.
        contact: index of the contact.
    """

    h: float
    point: PathPoint
    contact: int


class ContactMode:
    """Contacts that are closed along a segment of a path.

    Args:
        contacts: all contacts.
        closed: indices of the closed contacts.
    """

    def __init__(self, contacts: "Contacts", closed: set[int]) -> None:
        self.contacts, self.closed = contacts, closed

    @property
    def max_changes(self) -> int:
        """Largest number of successive changes without progress, after which a path ends."""
        return 1 + len(self.contacts.switches)

    def margin(self, k: int, point: PathPoint) -> float:
        """Return the gap of a contact if it is open, or its normal force if it is closed."""
        return self.contacts.margin(k, self.closed, point.balance)

    def first_change(self, locate: Locate, point: PathPoint, next_point: PathPoint, h: float) -> Change | None:
        """Return the first contact that closes or opens in a step; None if there is none.

        ``locate(point, h, margin)`` returns the step up to the zero of a margin, and its point.
        """
        found = []
        for k in self.contacts.violated(self.closed, next_point.balance):
            margin = partial(self.margin, k)
            found.append(Change(*(locate(point, h, margin) if margin(point) > 0 else (0.0, point)), k))
        return min(found, key=lambda change: change.h, default=None)

    def after_change(self, k: int) -> "ContactMode":
        """Return the mode after a change of contact k: closed if it was open, open if it was closed."""
        return ContactMode(self.contacts, self.closed ^ {k})

    def statics(self, before: Statics, loads: list[str]) -> Statics:
        """Return the balance of forces in this mode."""
        mode = self.contacts.mode(self.closed)
        return Statics(before.mech, before.t, before.v, before.locked, loads, mode=mode)
