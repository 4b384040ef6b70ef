"""Guards of open contacts in the compiled core, which also resolves impacts at which a single contact rebounds.

Such an impact leaves the mode as it is, and the core continues with the next steps. All other roots of guards are left
to Python: the core reports the next step as undecided, and takes it alone.
"""

from math import inf
from typing import TYPE_CHECKING, NamedTuple

from ...mechanism.hybrid.impact import Impact
from ...tolerances import MODE_ROUNDING
from .guard_location import GRAZING, MAX_NEWTON, RETURN_FACTOR, START_ROOT
from .level_crossing import RELATIVE_TOLERANCE, TIME_SPACINGS

if TYPE_CHECKING:
    from ..._native import ContactGuards
    from ...mechanism import Mechanism
    from .hybrid import ModeChanges


class Rebound(NamedTuple):
    """An impact at which a contact rebounds.

    Attributes:
        node: the first node after it, among those of the last steps.
        switch: index of the switch of the contact.
        work: the change of kinetic energy in J.
        impulses: impulses of all rows, (ng,).
    """

    node: int
    switch: int
    work: float
    impulses: list[float]

    def record(self, t: float, mechanism: "Mechanism") -> Impact:
        """Return the impact by name."""
        switch = mechanism.switches[self.switch]
        impulse = abs(self.impulses[switch.row])
        return Impact(t, (switch.name,), (impulse,), tuple(self.impulses), -self.work)


def set_constants(contacts: "ContactGuards", mechanism: "Mechanism") -> None:
    """Pass all thresholds to the core."""
    contacts.characteristic_rate, contacts.mode_rounding = float(mechanism.characteristic_rate), MODE_ROUNDING
    contacts.return_factor, contacts.start_root, contacts.grazing = RETURN_FACTOR, START_ROOT, GRAZING
    contacts.spacings, contacts.step_tolerance, contacts.iterations = TIME_SPACINGS, RELATIVE_TOLERANCE, MAX_NEWTON


def guards_to_core(contacts: "ContactGuards", changes: "ModeChanges") -> None:
    """Pass the guards of the mode to the core, with what is known of them so far."""
    contacts.set_guards(changes.core_guards or [])
    last = [changes.last_impact.get(x.guard.switch, -inf) for x in changes.guards]
    contacts.states = [(x.size, x.level, x.return_time, t) for x, t in zip(changes.guards, last, strict=True)]


def guards_from_core(contacts: "ContactGuards", changes: "ModeChanges") -> list[Rebound]:
    """Take over what the core knows of the guards; return the impacts of its last steps."""
    rebounds = [Rebound(node, i, work, impulses) for node, i, work, impulses in contacts.impacts]
    for guard, (size, level, return_time, last) in zip(changes.guards, contacts.states, strict=True):
        guard.size, guard.level, guard.return_time = size, level, return_time
        changes.last_impact[guard.guard.switch] = last
    return rebounds
