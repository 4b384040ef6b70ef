"""Equilibria that rest on stops, ropes and planes: 0 <= gap, 0 <= N, gap N = 0.

The search begins without contact. The first contact that is violated between start and equilibrium is closed, and the
search continues in that mode; a closed contact in tension is opened. The equilibrium is accepted when no gap is
negative and every closed contact is in compression.

Source: J. Nocedal, S. J. Wright, Numerical Optimization (2006), section 16.5, for the active-set iteration.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...errors import EquilibriumError
from ...mechanism import Mechanism
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.hybrid.kinds.unilateral import CLOSED as ACTIVE
from ...mechanism.hybrid.kinds.unilateral import OPEN, Unilateral
from ...mechanism.hybrid.mode_point import AllRows
from ...mechanism.hybrid.switches import Mode
from ...system import Array
from ...tolerances import CLOSED, MODE_ROUNDING
from .search import find_equilibrium

CHANGES = 20  # times the number of contacts plus one: more changes of the mode indicate a cycle


class Contacts:
    """Contacts of a mechanism that may support an equilibrium.

    Args:
        mech: the mechanism.
        t: time in s.
    """

    def __init__(self, mech: Mechanism, t: float) -> None:
        self.mech, self.t = mech, t
        self.switches = [s for s in mech.switches if type(s) is Unilateral]
        self.all_rows = AllRows(mech.system()) if self.switches else None
        self.rows = np.array([s.row for s in self.switches], int)
        self.signs = np.array([s.sign for s in self.switches])

    def gaps(self, q: Array) -> Array:
        """Return the gaps in rad and characteristic lengths, (k,)."""
        if self.all_rows is None:
            return np.empty(0)
        return self.signs * self.all_rows(self.t, q)[0][self.rows] / self.mech.row_scales[self.rows]

    def normal_forces(self, lam: Array) -> Array:
        """Return the normal forces in N, or N m, positive in compression, (k,); 0 for open contacts."""
        return self.signs * lam[self.rows]

    def mode(self, closed: set[int]) -> Mode:
        """Return the mode in which these contacts are closed."""
        out = [OPEN] * len(self.mech.switches)
        for k in closed:
            out[self.switches[k].index] = ACTIVE
        return tuple(out)

    def names(self, closed: set[int]) -> list[str]:
        """Return the names of contacts."""
        return [self.switches[k].name for k in sorted(closed)]

    def contacts_in_tension(self, closed: set[int], balance: ForceBalance) -> list[int]:
        """Return the closed contacts in tension, the largest tension first."""
        force, size = self.normal_forces(balance.lam), float(np.abs(balance.lam).max(initial=0.0))
        return sorted((k for k in closed if force[k] < -MODE_ROUNDING * size), key=lambda k: float(force[k]))

    def contact_forces(self, closed: set[int], lam: Array) -> dict[str, float]:
        """Return the normal forces of closed contacts by name, in N, or N m."""
        force = self.normal_forces(lam)
        return {self.switches[k].name: float(force[k]) for k in sorted(closed)}

    def margin(self, k: int, closed: set[int], balance: ForceBalance) -> float:
        """Return the gap of an open contact in rad or characteristic lengths, the normal force of a closed contact."""
        return float(self.normal_forces(balance.lam)[k] if k in closed else self.gaps(balance.q)[k])

    def violated(self, closed: set[int], balance: ForceBalance) -> list[int]:
        """Return the open contacts with negative gaps, and the closed contacts in tension."""
        gaps = self.gaps(balance.q)
        penetrating = [k for k in range(len(gaps)) if k not in closed and gaps[k] < -CLOSED]
        return penetrating + self.contacts_in_tension(closed, balance)

    def first_violated(self, closed: set[int], q0: Array, q1: Array) -> tuple[int, float] | None:
        """Return the open contact with a negative gap at q1 that closes first from q0 to q1, and the fraction at which.

        Gaps are interpolated linearly over the fraction of the displacement, between 0 and 1.
        """
        before, after = np.maximum(self.gaps(q0), 0.0), self.gaps(q1)
        negative = [k for k in range(len(after)) if k not in closed and after[k] < -CLOSED]
        fractions = [(float(before[k] / (before[k] - after[k])), k) for k in negative]
        return (min(fractions)[1], min(fractions)[0]) if fractions else None


class ContactEquilibrium(NamedTuple):
    """A balance of forces, and the contacts that support it.

    Attributes:
        statics: equilibrium equations of the mode.
        balance: balance of forces.
        residual: residual of the search.
        iterations: number of trial steps of all searches.
        contacts: normal forces in N, or N m, of the closed contacts by name.
        closed: indices of the closed contacts.
    """

    statics: Statics
    balance: ForceBalance
    residual: float
    iterations: int
    contacts: dict[str, float]
    closed: set[int]


def find_equilibrium_on_contacts(
    mech: Mechanism, t: float, v: Array, locked: Array, q: Array, find: str, loads: Sequence[str] = (), p: float = 1.0
) -> ContactEquilibrium:
    """Search for an equilibrium that violates no contact, with the factor p on some loads.

    Raises:
        EquilibriumError: if no equilibrium is found.
        InputError: for speeds that are not steady.
    """
    contacts, closed, iterations = Contacts(mech, t), set[int](), 0
    for _ in range(CHANGES * (1 + len(contacts.switches))):
        statics = Statics(mech, t, v, locked, loads, mode=contacts.mode(closed))
        statics.factor = p
        reason = None
        try:
            balance, residual, n = find_equilibrium(statics, q, find)
            reached, iterations = balance.q, iterations + n
        except EquilibriumError as e:
            reason, reached = e, np.array(e.q)
        violated = contacts.first_violated(closed, q, reached)
        if violated:
            k, fraction = violated
            closed.add(k)
            q = mech.manifold.integrate(q, fraction * mech.manifold.difference(q, reached))
            continue
        if reason:
            raise reason
        if in_tension := contacts.contacts_in_tension(closed, balance):
            closed.remove(in_tension[0])
            q = balance.q
            continue
        forces = contacts.contact_forces(closed, balance.lam)
        return ContactEquilibrium(statics, balance, residual, iterations, forces, closed)
    names = ", ".join(map(repr, contacts.names(closed)))
    raise EquilibriumError(f"no equilibrium: contacts open and close without end, with {names}", q.tolist(), np.inf, "")
