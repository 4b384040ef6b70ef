"""Equilibria and steady motions of a mechanism: holding forces and stability."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, UnknownNameError, as_list, is_number
from ...mechanism import Mechanism, ModelSource
from ...mechanism.flexible.linear_range import beyond_linear
from ...mechanism.signals.deformation import deformation, deformation_units
from ...mechanism.signals.reactions import Reaction, reaction
from ...mechanism.tree.coordinate_units import coordinate_units, effort_unit
from ...mechanism.tree.frames import find_joint
from ...solution.columns import coordinates
from ...solution.problem import mechanism_of
from ...solution.solution import Solution
from ...system import Array
from ...tabular import Columns, Tabular
from ...tolerances import ROUNDING, SOLUTION_ROUNDING, VISIBLE
from ...units import quantity
from .contacts import find_equilibrium_on_contacts
from .stability import Verdict, verdict

if TYPE_CHECKING:
    from ...mechanism.mechanism import Coordinates

__all__ = ["equilibrium"]

Find = Literal["stable", "any"]
FIND = get_args(Find)


@dataclass(frozen=True)
class Equilibrium(Tabular):
    """Result of `equilibrium`.

    Attributes:
        mechanism: the mechanism.
        t: time in s, for drivers and functions of time.
        q: configuration, (nq,).
        v: constant speeds, (nv,); zero at rest.
        s: states of controllers and actuators, (ns,).
        lam: multipliers of all rows, (ng,), of minimum norm.
        holding: torque in N m or force in N on each coordinate of locked joints, by name.
        residual: unbalanced force along free motions, relative to the largest force.
        iterations: number of trial steps.
        verdict: stability, and its criterion; contacts are assumed to remain closed.
        contacts: normal forces in N, or N m, of the stops, ropes and planes that support the equilibrium, by name.
        indeterminate: names in ``holding`` whose forces are statically indeterminate: they have minimum norm together
            with the multipliers.
    """

    mechanism: Mechanism
    t: float
    q: Array
    v: Array
    s: Array
    lam: Array
    holding: dict[str, float]
    residual: float
    iterations: int
    verdict: Verdict
    contacts: dict[str, float] = field(default_factory=dict)
    indeterminate: tuple[str, ...] = ()

    @property
    def stability(self) -> str:
        """``"stable"``, ``"unstable"``, ``"neutral"``, ``"rigid"`` (no degree of freedom) or ``"singular"``."""
        return self.verdict.stability

    @property
    def eigenvalues(self) -> Array:
        """Squares of the undamped angular frequencies in 1/s^2, negative for unstable motions, (k,)."""
        return self.verdict.squares

    @cached_property
    def coordinates(self) -> dict[str, float]:
        """The configuration by names ``q.<joint>``, see `mbdae.Solution.signals`."""
        y = np.concatenate([self.q, self.v, self.s, [0.0]])
        at = Solution(self.mechanism, np.zeros(1), y[None], self.lam[None], "finished", "", {}, {})
        return {name: float(x[0]) for name, x in coordinates(at).items() if name.startswith("q.")}

    @cached_property
    def deformation(self) -> dict[str, float]:
        """Displacements, strains and stresses of nodes of flexible bodies by names of `mbdae.Solution.signals`."""
        return {name: float(x[0]) for name, x in deformation(self.mechanism.model, self.q[None]).items()}

    @cached_property
    def warning(self) -> str:
        """Name of a flexible body that bends beyond the range of linear modes, in words; empty if none does."""
        return beyond_linear(self.mechanism.model, self.q[None])

    def reaction(self, name: str) -> Reaction:
        """Return force and torque of a closure between frames, see `mbdae.Solution.reaction`.

        Raises:
            UnknownNameError: for a name that does not exist.
        """
        return reaction(self.mechanism, name, np.array([self.t]), self.q[None], self.lam[None])

    def _contact_unit(self, name: str) -> str:
        row = next(s.row for s in self.mechanism.switches if s.name == name)
        return "N" if self.mechanism.row_units[row] == "m" else "N m"

    def to_columns(self) -> Columns:
        """Return one row: coordinates, deformation, states, holding forces and reactions, by names of signals."""
        units, values = coordinate_units(self.mechanism), {"t": self.t, **self.coordinates}
        known = {"t": "s", **{name: units[name] for name in self.coordinates if name in units}}
        values, known = values | self.deformation, known | deformation_units(self.mechanism.model)
        values |= {f"s.{name}": float(x) for name, x in zip(self.mechanism.states, self.s, strict=True)}
        for name, x in self.holding.items():
            values[f"holding.{name}"] = x
            known[f"holding.{name}"] = effort_unit(units, name)
        values |= {f"contact.{name}": x for name, x in self.contacts.items()}
        known |= {f"contact.{name}": self._contact_unit(name) for name in self.contacts}
        for c in self.mechanism.constraints:
            r = self.reaction(c.name) if c.frames else None
            for kind, vector, unit in (("force", r.force_world, "N"), ("torque", r.torque_world, "N m")) if r else ():
                components = dict(zip(("", ".x", ".y", ".z"), (np.linalg.norm(vector[0]), *vector[0]), strict=True))
                values |= {f"{kind}.{c.name}{end}": float(x) for end, x in components.items()}
                known |= {f"{kind}.{c.name}{end}": unit for end in components}
        return Columns({name: [x] for name, x in (values | {"stability": self.stability}).items()}, known)

    def cells(self) -> list[list[str]]:
        """Return every quantity with its value and unit."""
        found = self.to_columns().displayed()
        rows = [[n, x if isinstance(x, str) else f"{_shown(x):.8g}"] for n, (x,) in found.values.items()]
        return [["quantity", "value", "unit"], *([*row, found.units.get(row[0], "")] for row in rows)]

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        names = [c.name for c in self.mechanism.constraints if c.frames]
        forces = {name: self.reaction(name) for name in names}
        return {
            "title": self.mechanism.title,
            "t": self.t,
            "q": self.q.tolist(),
            "v": self.v.tolist(),
            "s": dict(zip(self.mechanism.states, self.s.tolist(), strict=True)),
            "coordinates": self.coordinates,
            "deformation": self.deformation,
            "lam": self.lam.tolist(),
            "holding": self.holding,
            "contacts": self.contacts,
            "reactions": {
                n: {"force": r.force_world[0].tolist(), "torque": r.torque_world[0].tolist()} for n, r in forces.items()
            },
            "residual": self.residual,
            "iterations": self.iterations,
            **self.verdict.to_dict(),
            "warning": self.warning,
        }

    def __str__(self) -> str:
        named = coordinate_units(self.mechanism)
        lines = [
            f"equilibrium of {self.mechanism.title}: {self.verdict}",
            f"  {self.iterations} iterations, unbalanced {self.residual:.1e} of the largest force",
        ]
        efforts = {name: effort_unit(named, name) for name in self.holding}
        lines += [f"  {n} = {quantity(_shown(x), named.get(n, ''), '.10g')}" for n, x in self.coordinates.items()]
        bent = {n: x for n, x in self.deformation.items() if _shown(x)}
        units = deformation_units(self.mechanism.model)
        lines += [f"  {n} = {quantity(x, units[n], '.8g')}" for n, x in bent.items()]
        lines += [f"  s.{name} = {x:.8g}" for name, x in zip(self.mechanism.states, self.s, strict=True)]
        lines += [f"  rests on {n} with {quantity(x, self._contact_unit(n), '.8g')}" for n, x in self.contacts.items()]
        remarks = dict.fromkeys(self.indeterminate, ", not unique (minimum norm)")
        held = {n: quantity(_shown(x), efforts[n], ".8g") for n, x in self.holding.items()}
        lines += [f"  {n} is held by {x}{remarks.get(n, '')}" for n, x in held.items()]
        lines += [self._reaction_text(c.name) for c in self.mechanism.constraints if c.frames]
        lines += [f"  frozen: {text}" for text in frozen_drivers(self.mechanism, self.q, self.v, self.t)]
        return "\n".join([*lines, *([f"  doubtful: {self.warning}"] if self.warning else [])])

    def _reaction_text(self, name: str) -> str:
        r = self.reaction(name)
        force, torque = (float(np.linalg.norm(x)) for x in (r.force, r.torque))
        moment = f", {quantity(torque, 'N m')}" if torque > SOLUTION_ROUNDING else ""
        return f"  {name} carries {quantity(force, 'N')}{moment}"


def _shown(x: float) -> float:
    """Return a number for display, with rounding errors as 0."""
    return x if abs(x) > ROUNDING else 0.0


def equilibrium(
    mech: Mechanism | ModelSource,
    q: "Coordinates | Array | None" = None,
    *,
    t: float = 0.0,
    v: "Coordinates | Array | None" = None,
    hold: str | Iterable[str] = (),
    find: Find = "stable",
) -> Equilibrium:
    """Find an equilibrium, 0 = f(t, q, v, s) + G^T lam, 0 = g(t, q), 0 = h(t, q, v, s), from a configuration.

    The search is a trust region over the free motions and needs no potential, so that controllers, motors and follower
    forces are allowed. States such as currents and integrators are determined, too; an integrator requires its
    reference value. Drivers are frozen at time t. Stops, ropes and planes support the mechanism by unilateral forces.

    With speeds it is a relative equilibrium: coordinates with a constant speed must be cyclic (the shaft of a
    governor); the torques that sustain the speeds are reported.

    Args:
        mech: the mechanism, or an argument of `mbdae.load`.
        q: start values of joints by name, or a full configuration (nq,); the model's start when left out.
        t: time in s.
        v: constant speeds by joint, in rad/s or m/s.
        hold: joints to lock at their start; their holding torques are reported.
        find: kind of equilibrium. ``"stable"`` rejects saddles and maxima; ``"any"`` accepts the nearest equilibrium of
            any kind.

    Returns:
        The equilibrium, with a verdict.

    Raises:
        EquilibriumError: if no equilibrium is found; with the smallest residual and its joint.
        InputError: for a wrong argument, or speeds that are not steady.
        UnknownNameError: for a joint that does not exist.
        AssemblyError: if the start cannot be assembled.

    Source: Conn, Gould, Toint, Trust-Region Methods (2000), chapter 7.
    """
    mech = mechanism_of(mech, "equilibrium")
    if find not in FIND:
        raise UnknownNameError("kind of equilibrium", find, FIND)
    q0, speeds, locked, names = complete_arguments(mech, q, t, v, hold)
    found = find_equilibrium_on_contacts(mech, t, speeds, locked, q0, find)
    statics, balance, residual, iterations, contacts, _ = found
    holding = dict(zip(names, balance.holding.tolist(), strict=True))
    stability, indeterminate = verdict(statics, balance), tuple(compress(names, balance.indeterminate))
    state = balance.q, speeds, balance.s, balance.lam
    return Equilibrium(mech, t, *state, holding, residual, iterations, stability, contacts, indeterminate)


def complete_arguments(
    mech: Mechanism, q: Any, t: float, v: Any, hold: str | Iterable[str]
) -> tuple[Array, Array, Array, list[str]]:
    """Return an assembled start configuration (nq,), speeds (nv,), the indices of locked velocities, and their names.

    Raises:
        InputError, UnknownNameError: for wrong values or names.
    """
    require_time(t)
    start = mech.start_at(t)[0] if q is None else mech.assemble(q, t=t)[0]
    if isinstance(v, Mapping):
        speeds, moving = mech.coordinates(v, of_v=True)
    else:
        speeds = np.zeros(mech.nv) if v is None else mech.vector("v", v, mech.nv)
        moving = np.flatnonzero(speeds)
    fixed = [i for name in as_list(hold, "hold is a list of joints") for i in velocity_indices(mech, name)]
    locked = np.unique(np.array([*fixed, *moving], int))
    return start, speeds, locked, velocity_labels(mech, locked)


def frozen_drivers(mech: Mechanism, q: Array, v: Array, t: float) -> list[str]:
    """Return the drivers whose speeds at time t differ from those of v, with the omitted speeds."""
    system, found = mech.system(), []
    along, speeds = system.jacobian(q) @ v, -system.g_t(t)
    for driver in mech.drivers:
        row = mech.rows_of(driver.name)[0]
        if abs(along[row] - speeds[row]) > VISIBLE * abs(speeds[row]):
            speed = quantity(speeds[row], f"{mech.row_units[row]}/s")
            found.append(f"{driver.name!r} at t = {quantity(t, 's')}, without its speed of {speed}")
    return found


def require_time(t: object) -> None:
    """Require a time in s.

    Raises:
        InputError: for an argument that is not a finite number.
    """
    if not is_number(t):
        raise InputError(f"t is a time in s, got {t!r:.60}")


def velocity_indices(mech: Mechanism, name: str) -> range:
    """Return the indices of a joint in v.

    Raises:
        UnknownNameError: for a joint that does not exist.
    """
    joint = find_joint(mech.model, name)
    return range(joint.idx_v, joint.idx_v + joint.nv)


def velocity_labels(mech: Mechanism, indices: Array) -> list[str]:
    """Return names of velocities: the joint, with the number of the coordinate if it has several."""
    joints = [mech.coordinate_joint(int(i)) for i in indices]
    spans = [velocity_indices(mech, name) for name in joints]
    return [n if len(at) == 1 else f"{n}.{i - at[0] + 1}" for n, at, i in zip(joints, spans, indices, strict=True)]
