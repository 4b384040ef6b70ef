"""Guards of contacts in the compiled core, and impacts that leave the mode as it is.

The core checks open contacts, and closed ones without friction, in many steps, and resolves impacts at which one
contact rebounds while closed ones remain under load; then it continues. All other roots of guards, and loads that are
close to zero or not resolved, are left to Python: the core reports the next step as undecided, and takes it alone.
"""

from collections.abc import Sequence
from math import inf
from typing import TYPE_CHECKING, NamedTuple

from ...mechanism.hybrid.impact import Impact, positive_impulses
from ...tolerances import MODE_ROUNDING
from .guard_location import GRAZING, MAX_HALVINGS, MAX_NEWTON, RETURN_FACTOR, START_ROOT
from .level_crossing import MAX_ITERATIONS, RELATIVE_TOLERANCE, TIME_SPACINGS
from .load_resolution import CLOSE_EXTREMUM, NEAR_LIMIT, OUTSIDE, ROUGH, SAFETY, SHRINK

if TYPE_CHECKING:
    from ..._native import ContactGuards
    from ...mechanism.hybrid.switch import Switch
    from ...mechanism.hybrid.switches import Mode
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

    def record(self, t: float, switches: "Sequence[Switch]", mode: "Mode") -> Impact:
        """Return the impact by name: of this contact, and of those that are closed in the mode."""
        closed = [s for s in switches if s.index == self.switch or mode[s.index]]
        found = positive_impulses((s.name, abs(self.impulses[s.row])) for s in closed)
        where, impulse = zip(*found, strict=True)
        return Impact(t, where, impulse, tuple(self.impulses), -self.work)


def set_constants(contacts: "ContactGuards") -> None:
    """Pass all thresholds to the core."""
    contacts.mode_rounding = MODE_ROUNDING
    contacts.return_factor, contacts.start_root, contacts.grazing = RETURN_FACTOR, START_ROOT, GRAZING
    contacts.spacings, contacts.step_tolerance, contacts.iterations = TIME_SPACINGS, RELATIVE_TOLERANCE, MAX_NEWTON
    contacts.root_iterations, contacts.max_halvings = MAX_ITERATIONS, MAX_HALVINGS
    contacts.rough, contacts.near_limit, contacts.close_extremum = ROUGH, NEAR_LIMIT, CLOSE_EXTREMUM
    contacts.outside, contacts.safety, contacts.shrink = OUTSIDE, SAFETY, SHRINK


def guards_to_core(contacts: "ContactGuards", changes: "ModeChanges", shortest: float) -> None:
    """Pass the guards of the mode to the core, with what is known of them so far, and the shortest step in s."""
    contacts.shortest, contacts.characteristic_rate = shortest, float(changes.system.mechanism.characteristic_rate)
    contacts.set_guards(changes.core_guards or [])
    last = [changes.last_impact.get(x.guard.switch, -inf) for x in changes.guards]
    contacts.states = [(x.size, x.level, x.return_time, x.unit, t) for x, t in zip(changes.guards, last, strict=True)]


def guards_from_core(contacts: "ContactGuards", changes: "ModeChanges | None") -> dict[int, Rebound] | None:
    """Take over what the core knows of the guards; return the impacts of its last steps by node.

    None if Python must check the guards of the last step.
    """
    if changes is None:
        return {}
    if not contacts.in_core:
        return None
    for guard, (*tracked, last) in zip(changes.guards, contacts.states, strict=True):
        guard.size, guard.level, guard.return_time, guard.unit = tracked
        changes.last_impact[guard.guard.switch] = last
    changes.checked_in_core = True
    return {impact[0]: Rebound(*impact) for impact in contacts.impacts}
