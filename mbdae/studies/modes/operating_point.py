"""Operating point of a linearization."""

import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ...errors import EquilibriumError, InputError, as_list
from ...mechanism import Mechanism
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.equilibrium.linearization import LinearMotion, linearize_at, require_steady
from ...system import Array
from ...tolerances import CLOSED
from ..statics.contacts import Contacts, find_equilibrium_on_contacts
from ..statics.equilibrium import complete_arguments, frozen_drivers, require_time, velocity_indices, velocity_labels
from ..statics.stability import loses_rank

if TYPE_CHECKING:
    from ...mechanism.mechanism import Coordinates


def operating_point(
    mech: Mechanism,
    q: "Coordinates | Array | None",
    v: "Coordinates | Array | None",
    t: float,
    hold: str | Iterable[str],
) -> tuple[Statics, ForceBalance, LinearMotion, str]:
    """Return the equations and the force balance of an operating point, its linearization, and its kind.

    A full configuration (nq,) is used unchanged, with the speeds v. By default, the start is used if it is an
    equilibrium or a steady motion with its speeds; else the equilibrium found from there.

    Raises:
        InputError: for a configuration that is not an equilibrium, without degrees of freedom, or where closures lose
            rank or a force has no direction.
        EquilibriumError: if none is found.
    """
    require_time(t)
    names = as_list(hold, "hold is a list of joints")
    locked = np.unique(np.array([i for name in names for i in velocity_indices(mech, name)], int))
    found, not_steady = None, ""
    if isinstance(q, np.ndarray):
        q0 = mech.assemble(q, t=t)[0]
        speeds = complete_arguments(mech, q, t, v, hold)[1]
        found = _balance_at(mech, q0, speeds, t, locked), "given"
    elif q is None and v is None:
        try:
            found = _balance_at(mech, *mech.start_at(t), t, locked), "start"
        except InputError as e:
            not_steady = f"; the start moves, but {e}" if _has_start_speeds(mech) else ""
    if found is None:
        found = _at_equilibrium(mech, complete_arguments(mech, q, t, v, hold)[:3], t, locked, not_steady)
    (statics, balance), kind = found
    if not balance.free.Z.shape[1] and not len(balance.s):
        resting = [repr(s.name) for s in mech.switches if statics.system.mode[s.index]]
        where = _locked_text(mech, locked) + (f", resting on {', '.join(resting)}" if resting else "")
        raise InputError(f"{mech.title!r} has no degree of freedom left{where}: it has no modes")
    if loses_rank(statics, balance):
        raise InputError(f"the closures of {mech.title!r} lose rank in this pose: motions near it cannot be linearized")
    _warn_of_frozen_drivers(statics, balance)
    statics.system.inertia(t, balance.q)
    statics.system.laws.require_directions()
    return statics, balance, linearize_at(statics, balance), kind


def _at_equilibrium(
    mech: Mechanism, start: tuple[Array, Array, Array], t: float, locked: Array, not_steady: str
) -> tuple[tuple[Statics, ForceBalance], str]:
    """Return the balance at the stable equilibrium found from a configuration with speeds and fixed coordinates.

    Raises:
        EquilibriumError: if none is found; the message includes why the start is not a steady motion.
    """
    q, speeds, fixed = start
    try:
        equilibrium = find_equilibrium_on_contacts(mech, t, speeds, fixed, q, "stable")
    except EquilibriumError as e:
        raise EquilibriumError(f"{e}{not_steady}", e.q, e.residual, e.joint) from None
    statics = Statics(mech, t, speeds, locked, mode=equilibrium.statics.system.mode)
    found = statics, statics.point(equilibrium.balance.q, equilibrium.balance.s)
    return found, "steady motion" if speeds.any() else "equilibrium"


def _has_start_speeds(mech: Mechanism) -> bool:
    values = mech.start_values
    return any(map(np.any, [*values.v.values(), *values.guess_v.values()]))


def _warn_of_frozen_drivers(statics: Statics, balance: ForceBalance) -> None:
    if frozen := frozen_drivers(statics.mech, balance.q, statics.v, statics.t):
        remedy = "a steady motion has speeds of joints, v={...} or --v joint=value"
        warnings.warn(f"this linearization freezes {', '.join(frozen)}: {remedy}", stacklevel=4)


def _locked_text(mech: Mechanism, locked: Array) -> str:
    return f" with {', '.join(velocity_labels(mech, locked))} locked" if len(locked) else ""


def _balance_at(mech: Mechanism, q: Array, v: Array, t: float, locked: Array) -> tuple[Statics, ForceBalance]:
    """Return the balance at a configuration that is supported by the contacts that are closed and in compression.

    Raises:
        InputError: for a configuration that is not an equilibrium, or that violates a contact.
    """
    contacts = Contacts(mech, t)
    gaps, states = contacts.gaps(q), np.array(list(mech.states.values()))
    if (gaps < -CLOSED).any():
        raise InputError(f"this configuration violates {contacts.names({int(gaps.argmin())})[0]!r}")
    closed = set(np.flatnonzero(gaps <= CLOSED).tolist())
    while True:
        statics = Statics(mech, t, v, locked, mode=contacts.mode(closed))
        balance = statics.point(q, states)
        if not (in_tension := contacts.contacts_in_tension(closed, balance)):
            require_steady(statics, balance)
            return statics, balance
        closed.remove(in_tension[0])
