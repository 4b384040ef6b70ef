"""Signals: named columns of a solution with units, used by tables, plots, sweeps and events."""

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ..errors import UnknownNameError, as_list
from ..mechanism import Driver
from ..mechanism.closures.unilateral_constraint import Stop
from ..mechanism.signals.contacts import rolling_closures
from ..mechanism.signals.deformation import deformation, deformation_units
from ..mechanism.signals.effort_signals import brake_rows, driver_powers, effort_units, efforts, friction_powers
from ..mechanism.signals.momentum import MOMENTUM, SHAKING, momentum, shaking_force
from ..mechanism.tree.coordinate_units import acceleration_units, coordinate_units
from ..system import Array
from .columns import (
    CONTACT,
    contact_forces,
    contact_paths,
    coordinates,
    force_rows,
    frame_columns,
    frame_units,
    reaction_columns,
    reaction_units,
    residuals,
    row_names,
)
from .mode_columns import mode_columns, mode_units
from .work_columns import WORK, work_columns, work_units

if TYPE_CHECKING:
    from ..mechanism import Mechanism
    from .solution import Solution

Units = dict[str, str]


class SignalGroup(NamedTuple):
    """Signals that are computed together.

    Attributes:
        units: their names and units.
        values: the columns, each (n,).
    """

    units: Callable[["Mechanism"], Units]
    values: Callable[["Solution"], Mapping[str, Array]]


def _time(sol: "Solution") -> dict[str, Array]:
    return {"t": np.asarray(sol.t)}


def _states(sol: "Solution") -> dict[str, Array]:
    return {f"s.{name}": sol.s[:, i] for i, name in enumerate(sol.mechanism.states)}


def _contact_units(mech: "Mechanism") -> Units:
    return {f"contact.{c.name}.{x}": "m" for c in rolling_closures(mech) for x in "xyz"}


def _multipliers(mech: "Mechanism") -> Units:
    return dict(zip(row_names(mech), ["N" if u == "m" else "N m" for u in mech.row_units], strict=True))


def _contact_force_units(mech: "Mechanism") -> Units:
    return {f"{kind}.{c.name}": "1" if kind == "friction" else "N" for c in rolling_closures(mech) for kind in CONTACT}


def _accelerations(sol: "Solution") -> dict[str, Array]:
    return dict(zip(acceleration_units(sol.mechanism), sol.vdot.T, strict=True))


def _forces(sol: "Solution") -> dict[str, Array]:
    return {
        f"force.{name}": np.linalg.norm(sol.lam[:, rows], axis=1) for name, rows in force_rows(sol.mechanism).items()
    }


def effort_rows(mech: "Mechanism") -> dict[str, int]:
    """Return the row of each coupling, driver and limit of a stop; its multiplier is the effort."""
    stops = [c for c in mech.constraints if isinstance(c, Stop)]
    single = [c for c in mech.constraints if isinstance(c, Driver) or (not c.frames and c.m == 1)]
    limits = {name: row for c in stops for name, row in zip(c.one_sided_names, mech.rows_of(c.name), strict=True)}
    return {c.name: mech.rows_of(c.name)[0] for c in single} | limits


def _effort_units(mech: "Mechanism") -> Units:
    efforts = {f"effort.{name}": "N" if mech.row_units[i] == "m" else "N m" for name, i in effort_rows(mech).items()}
    return efforts | {f"power.{name}": "W" for name in (*(d.name for d in mech.drivers), *brake_rows(mech))}


def _efforts(sol: "Solution") -> dict[str, Array]:
    out = {f"effort.{name}": sol.lam[:, i] for name, i in effort_rows(sol.mechanism).items()}
    return out | driver_powers(sol.mechanism, sol.t, sol.lam) | friction_powers(sol.mechanism, sol.v, sol.lam)


def _energies(sol: "Solution") -> dict[str, Array]:
    r = residuals(sol)
    sums = {"kinetic": r.kinetic, "potential": r.potential, "energy": r.kinetic + r.potential, "work": sol.work}
    return sums | {name: np.abs(x).max(axis=1, initial=0.0) for name, x in (("g", r.g), ("Gv", r.Gv))}


ENERGIES = {**dict.fromkeys(("kinetic", "potential", "energy", "work"), "J"), "g": "m, rad", "Gv": "m/s, rad/s"}
SIGNAL_GROUPS = (
    SignalGroup(lambda mech: {"t": "s"}, _time),
    SignalGroup(coordinate_units, coordinates),
    SignalGroup(_contact_units, contact_paths),
    SignalGroup(lambda mech: {f"s.{name}": "" for name in mech.states}, _states),
    SignalGroup(_multipliers, lambda sol: dict(zip(row_names(sol.mechanism), sol.lam.T, strict=True))),
    SignalGroup(_contact_force_units, contact_forces),
    SignalGroup(acceleration_units, _accelerations),
    SignalGroup(reaction_units, reaction_columns),
    SignalGroup(
        lambda mech: {f"force.{name}": "N" for name in force_rows(mech)}, _forces
    ),  # faster than `reaction_columns` for these
    SignalGroup(_effort_units, _efforts),
    SignalGroup(effort_units, lambda sol: efforts(sol.mechanism, sol.t, sol.q, sol.v, sol.s)),
    SignalGroup(frame_units, frame_columns),
    SignalGroup(lambda mech: MOMENTUM, lambda sol: momentum(sol.mechanism.model, sol.q, sol.v)),
    SignalGroup(lambda mech: SHAKING, lambda sol: shaking_force(sol.mechanism.model, sol.q, sol.v, sol.vdot)),
    SignalGroup(mode_units, mode_columns),
    SignalGroup(work_units, work_columns),
    SignalGroup(lambda mech: deformation_units(mech.model), lambda sol: deformation(sol.mechanism.model, sol.q)),
    SignalGroup(lambda mech: ENERGIES, _energies),
)
_UNITS: "WeakKeyDictionary[Mechanism, list[Units]]" = WeakKeyDictionary()  # mechanisms are immutable


def units(mech: "Mechanism") -> Units:
    """Return the names and units of all columns of `signals`."""
    return {name: unit for group in _units(mech) for name, unit in group.items()}


def _units(mech: "Mechanism") -> list[Units]:
    if mech not in _UNITS:
        _UNITS[mech] = [group.units(mech) for group in SIGNAL_GROUPS]
    return _UNITS[mech]


def signals(sol: "Solution", names: Collection[str] | None = None) -> dict[str, Array]:
    """Return named columns of equal length, with the units of `units`.

    ``t`` in s; ``q.<joint>``, ``v.<joint>`` and ``a.<joint>`` (rad or m, per s, per s^2), with a suffix for joints with
    several coordinates (``q.base.x``, ``v.base.wz``); unbounded revolute joints as one angle, unwrapped over the run;
    ``s.<state>`` of forces with internal states.

    ``lam.<closure>.<row>`` with rows counted from 1 (N, N m; from the hidden constraint); ``force.<name>`` and
    ``torque.<name>`` (N, N m) of joints, closures and driven distances: the magnitude, or with suffix ``.x .y .z``
    components along world axes, with ``.1 .2 .3`` along local axes, see
    `mbdae.mechanism.signals.joint_wrenches.reaction_wrenches`; ``effort.<name>``, the generalized force of couplings
    and drivers (N, N m), ``power`` of drivers and of joints that stick (W); of forces ``torque``, ``force``, ``power``
    and ``deflection.<force>``; ``work.<name>`` of drivers and forces since the start in J, see
    `mbdae.solution.work_columns` and `mbdae.mechanism.signals.effort_signals`; of rolling bodies
    ``contact.<closure>.x`` in m, ``normal``, ``longitudinal`` and ``lateral.<closure>`` in N, and
    ``friction.<closure>``, the friction coefficient required not to slip.

    ``position``, ``velocity`` and ``acceleration.<frame>.x`` of the origins of frames in the world (m, per s, per s^2),
    without ``.x`` the magnitudes of the last two; ``com.x`` in m, the centre of mass of the mechanism, ``momentum.x``
    (kg m/s) and ``angular_momentum.x`` (kg m^2/s) about it; ``shaking_force.x`` (N) and ``shaking_moment.x`` (N m) of
    the inertia forces, without ``.x`` their magnitudes, see `mbdae.mechanism.signals.momentum`; ``kinetic``,
    ``potential``, ``energy``, and ``work`` of the non-conservative forces and drivers in J; of switches ``gap``,
    ``mode`` and ``impulse.<name>``, see `mbdae.solution.mode_columns`; of nodes of flexible bodies
    ``displacement.<node>.x`` in m in the axes of the body, ``strain.<node>`` and ``stress.<node>`` (N/m^2) of a fibre;
    ``g`` and ``Gv``, the largest |g| and |G v + g_t| over all rows.

    Args:
        sol: the solution.
        names: the requested columns, in this order, see `find`; when left out, all but ``work.<name>``, whose
            integrals take longer than all the rest. Expensive columns are computed only on request.

    Raises:
        UnknownNameError: for an unknown signal.
        InputError: for a solution of a textbook problem, or one without times.
    """
    mech = sol.mechanism
    requested = [name for name in units(mech) if not name.startswith(WORK)] if names is None else find(mech, names)
    out: dict[str, Array] = {}
    with np.errstate(over="ignore", invalid="ignore"):  # overflow of a diverging run
        for group, group_units in zip(reversed(SIGNAL_GROUPS), reversed(_units(mech)), strict=True):
            if any(name in group_units and name not in out for name in requested):
                out |= group.values(sol)
    return {name: out[name] for name in requested}


def choices(mech: "Mechanism") -> list[str]:
    """Return the names that `find` accepts: first the prefixes of several names."""
    all_units = units(mech)
    return list({n[:i]: None for n in all_units for i in range(len(n)) if n[i] == "."} | dict.fromkeys(all_units))


def find(mech: "Mechanism", names: str | Iterable[str]) -> list[str]:
    """Return names of columns, given names and prefixes: ``"q"``, ``"force.crank"``, ``"position.tip"``.

    Raises:
        UnknownNameError: for a name that is neither a signal nor a prefix.
    """
    all_units = units(mech)
    out: dict[str, None] = {}
    for name in as_list(names, "signals are a list of names"):
        if name not in all_units and not any(x.startswith(f"{name}.") for x in all_units):
            raise UnknownNameError("signal", name, choices(mech))
        out |= {name: None} if name in all_units else {x: None for x in all_units if x.startswith(f"{name}.")}
    return list(out)
