"""Operating point of a linearisation."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError, as_list
from ...mechanism import Mechanism
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.equilibrium.linearization import LinearMotion, linearize_at, require_steady
from ...system import Array
from ..statics.equilibrium import balanced, complete_arguments, velocities, velocity_labels
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
    """Return the force balance at which to linearise, and its kind.

    A full configuration (nq,) is used unchanged, with the speeds v. By default, the start is used if it is an
    equilibrium or a steady motion with its speeds; else the equilibrium found from there.

    Raises:
        InputError: for a configuration that is not an equilibrium, without degrees of freedom, or where closures lose
            rank or a force has no direction.
        EquilibriumError: if none is found.
    """
    names = as_list(hold, "hold is a list of joints")
    locked = np.unique(np.array([i for name in names for i in velocities(mech, name)], int))
    found = None
    if isinstance(q, np.ndarray):
        q0 = mech.assemble(q, t=t)[0]
        speeds = complete_arguments(mech, q, t, v, hold)[1]
        found = _at(mech, q0, speeds, t, locked), "given"
    elif q is None and v is None:
        try:
            found = _at(mech, *mech.start_at(t), t, locked), "start"
        except InputError:
            found = None
    if found is None:
        q0, speeds, fixed, _ = complete_arguments(mech, q, t, v, hold)
        here = balanced(Statics(mech, t, speeds, fixed), q0, "stable")[0]
        statics = Statics(mech, t, speeds, locked)
        found = (statics, statics.point(here.q, here.s)), "steady motion" if speeds.any() else "equilibrium"
    (statics, here), kind = found
    if not here.free.Z.shape[1] and not len(here.s):
        raise InputError(f"{mech.title!r} has no degree of freedom left{_locked_text(mech, locked)}: it has no modes")
    if loses_rank(statics, here):
        raise InputError(f"the closures of {mech.title!r} lose rank in this pose: motions near it cannot be linearised")
    statics.system.inertia(t, here.q)
    statics.system.laws.require_directions()
    return statics, here, linearize_at(statics, here), kind


def _locked_text(mech: Mechanism, locked: Array) -> str:
    return f" with {', '.join(velocity_labels(mech, locked))} locked" if len(locked) else ""


def _at(mech: Mechanism, q: Array, v: Array, t: float, locked: Array) -> tuple[Statics, ForceBalance]:
    statics = Statics(mech, t, v, locked)
    here = statics.point(q, np.array(list(mech.states.values())))
    require_steady(statics, here)
    return statics, here
