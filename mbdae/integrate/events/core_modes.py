"""Modes of a run in the compiled core: guards, impacts and changes of the mode, many steps at a time.

The core has stops, contacts, one-way clutches, ratchets, sticking joints and ranges. Rare cases are left to Python:
complementarity problems that are large or have several solutions, unilateral rows with lam = 0 and zero
acceleration, modes close to singular configurations. The core then reports the next step as undecided, and takes only
this step.
"""

from math import inf
from typing import TYPE_CHECKING, NamedTuple

from ...data_types import CoreData
from ...mechanism.closures.independent_rows import AMBIGUOUS_AFTER_START, RANK_LOSS_FACTOR
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.hybrid.impact import Impact
from ...mechanism.hybrid.impact_law import MAX_IMPACTS
from ...mechanism.hybrid.kinds.frictional_contact import AT_LIMIT
from ...mechanism.hybrid.kinds.range_switch import LOOKAHEAD
from ...mechanism.hybrid.kinds.rolling_stiction import TRANSVERSE
from ...tolerances import COINCIDENT, MODE_ROUNDING
from .guard_location import GRAZING, MAX_HALVINGS, MAX_NEWTON, RETURN_FACTOR, START_ROOT
from .level_crossing import MAX_ITERATIONS, RELATIVE_TOLERANCE, TIME_SPACINGS
from .multiplier_resolution import (
    CLOSE_EXTREMUM,
    MAX_DEVIATION,
    MAX_INTERVALS,
    MIN_DISTANCE,
    RANGE_MARGIN,
    SAFETY,
    SHRINK,
)

if TYPE_CHECKING:
    from ..._native import Core, Modes
    from ...mechanism import Mechanism
    from ...system import Array
    from .mode_changes import ModeChanges

MAX_STATES = 1000  # combinations of the states of all rows of a complementarity problem, which the core enumerates


class CoreTransition(NamedTuple):
    """A change of the mode, or an impact in the same mode.

    Attributes:
        node: the first node after it, among those of the last steps.
        fired: indices of the switches whose guards end the mode.
        mode: the mode after it.
        is_impact: whether it is an impact.
        contacts: indices of the switches with an impulse.
        engaged: indices of bilateral rows that become active by an impulse.
        work: the change of kinetic energy in J.
        impulses: impulses of all rows, (ng,).
    """

    node: int
    fired: list[int]
    mode: list[int]
    is_impact: bool
    contacts: list[int]
    engaged: list[int]
    work: float
    impulses: list[float]

    def impact(self, t: float, mechanism: "Mechanism") -> Impact | None:
        """Return the impact by name; None if there is none."""
        if not self.is_impact:
            return None
        p, switches = self.impulses, [mechanism.switches[i] for i in self.contacts]
        impulses_by_name = [(s.name, abs(p[s.row])) for s in switches]
        impulses_by_name += [(mechanism.row_names[k], p[k]) for k in self.engaged]
        where, impulse = zip(*impulses_by_name, strict=True) if impulses_by_name else ((), ())
        return Impact(t, tuple(where), tuple(impulse), tuple(p), -self.work)


def core_switches(system: "Index2System") -> list[CoreData] | None:
    """Return the core data of all switches of a workspace; None if the core does not support one of them."""
    candidates = [s.core_data(system) for s in system.mechanism.switches] if system.native else []
    supported = [x for x in candidates if x is not None]
    return supported if supported and len(supported) == len(candidates) else None


def set_constants(modes: "Modes") -> None:
    """Pass all thresholds to the core."""
    modes.mode_rounding, modes.coincident = MODE_ROUNDING, COINCIDENT
    modes.return_factor, modes.start_root, modes.grazing = RETURN_FACTOR, START_ROOT, GRAZING
    modes.spacings, modes.step_tolerance, modes.iterations = TIME_SPACINGS, RELATIVE_TOLERANCE, MAX_NEWTON
    modes.root_iterations, modes.max_halvings = MAX_ITERATIONS, MAX_HALVINGS
    modes.rough, modes.near_limit, modes.close_extremum = MAX_DEVIATION, MIN_DISTANCE, CLOSE_EXTREMUM
    modes.outside, modes.finest, modes.safety, modes.shrink = RANGE_MARGIN, MAX_INTERVALS, SAFETY, SHRINK
    modes.transverse, modes.at_limit, modes.lookahead = TRANSVERSE, AT_LIMIT, LOOKAHEAD
    modes.ambiguous, modes.fallen = AMBIGUOUS_AFTER_START, RANK_LOSS_FACTOR
    modes.max_impacts, modes.max_states = MAX_IMPACTS, MAX_STATES


def modes_to_core(modes: "Modes", changes: "ModeChanges", shortest: float) -> None:
    """Pass the mode and its guards to the core, and the shortest step in s."""
    modes.shortest, modes.characteristic_rate = shortest, float(changes.system.mechanism.characteristic_rate)
    modes.mode = list(changes.system.mode)
    modes.last_impact = [changes.last_impact.get(s.index, -inf) for s in changes.switches]
    modes.states = [(x.size, x.level, x.return_time, x.unit) for x in changes.guards]


def transitions_from_core(modes: "Modes", changes: "ModeChanges | None") -> dict[int, CoreTransition] | None:
    """Return the transitions of the last steps by node; None if Python must check the guards of the last step."""
    if changes is None:
        return {}
    if not modes.in_core:
        return None
    changes.checked_in_core = True
    transitions = [CoreTransition(*x) for x in modes.transitions]
    return {x.node: x for x in transitions}


def modes_from_core(modes: "Modes", changes: "ModeChanges", core: "Core", t: float, y: "Array") -> None:
    """Adopt the mode of the core at a point, its rows in use, and the state of its guards."""
    if modes.transitions:
        system, rows, floor = changes.system, core.rows, core.floor
        Index2System.enter(system, tuple(modes.mode))  # the core itself is in this mode
        system.rank_threshold = floor
        system.use_rows(tuple(rows))
        changes.adopt_guards(t, y)
    for guard, state in zip(changes.guards, modes.states, strict=True):
        guard.size, guard.level, guard.return_time, guard.unit = state
