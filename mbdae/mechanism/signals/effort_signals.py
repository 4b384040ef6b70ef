"""Outputs of force elements by name: generalized force, power, deflection.

A force along one coordinate has ``torque.<name>`` in N m for rotations and ``force.<name>`` in N for translations;
along several coordinates, ``torque.<name>.<joint>`` and so on; it is positive along the coordinate. A spring, damper or
force actuator between two points has its tension ``force.<name>``, positive when it pulls them together; a bushing or a
wrench has force and torque on its second frame, at its origin: the magnitude, and ``.x .y .z`` along the world's axes.
``power.<name>`` in W is the power of the force on the mechanism. ``deflection.<name>`` is the deflection of a spring
from its rest length or angle, and ``deflection.<name>.x`` to ``.rz`` of a bushing in axes of the first frame. If a
joint, closure or driver has the same name, "(force)" is appended to the name of the force. Dry friction of sticking
joints, and friction proportional to closure forces, do not follow from the state: they are outputs of rows,
``effort.<name>``, the former with ``power.<joint> friction``.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ..closures.brake import Brake
from ..forces.elements import ForceElements
from ..forces.force import ForceElement, PairElement
from ..tree.coordinate_units import coordinate_units
from ..tree.frames import find_joint, joint_names, skew, unit_gap
from ..tree.tree_terms import update_poses

if TYPE_CHECKING:
    from ..mechanism import Mechanism

QUANTITY = {"N": "force", "N m": "torque"}  # by unit


def effort_units(mech: "Mechanism") -> dict[str, str]:
    """Return names and units of the columns of `efforts`."""
    out: dict[str, str] = {}
    coordinates = _coordinates(mech)
    for name, law in named_laws(mech, mech.bind_forces(mech.make_workspace())).items():
        if law.tension:
            out[f"force.{name}"] = "N"
        elif isinstance(law, PairElement):
            suffixes = ("", ".x", ".y", ".z")
            out |= {f"{word}.{name}{suffix}": unit for unit, word in QUANTITY.items() for suffix in suffixes}
        else:
            acting = law.acting_components(len(coordinates))
            for i in acting:
                coordinate, unit = coordinates[i]
                out[f"{QUANTITY[unit]}.{name}" + (f".{coordinate}" if len(acting) > 1 else "")] = unit
        out[f"power.{name}"] = "W"
        for i, axis in law.deflections:
            coordinate, unit = coordinates[i] if i >= 0 else ("", "N m" if axis.startswith("r") else "N")
            suffix = axis or (coordinate if len(law.deflections) > 1 else "")
            out[f"deflection.{name}" + (f".{suffix}" if suffix else "")] = "rad" if unit == "N m" else "m"
    return out


def efforts(mech: "Mechanism", t: Array, q: Array, v: Array, s: Array) -> dict[str, Array]:
    """Return the outputs of each force at the times of a motion, (n,) each.

    Args:
        mech: the mechanism.
        t: times, (n,).
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        s: states of forces, (n, ns).
    """
    names = list(effort_units(mech))
    out = np.empty((len(t), len(names)))
    with mech.workspaces.borrowed() as system:
        laws = list(named_laws(mech, system.laws).values())
        single_laws = [ForceElements([law], mech.model) for law in laws]
        state_slices = {id(law): span for law, span in system.laws.bound}
        for row, time, configuration, velocity, state in zip(out, t, q, v, s, strict=True):
            update_poses(mech.model, system.workspace, configuration)
            values: list[float] = []
            for law, single in zip(laws, single_laws, strict=True):
                tau, _ = single.generalized_force(time, configuration, velocity, state[state_slices[id(law)]])
                values += _force_outputs(law, float(time), velocity, tau)
                values.append(float(tau @ velocity))
                values += law.deflection(configuration).tolist()
            row[:] = values
    return dict(zip(names, out.T, strict=True))


def driver_powers(mech: "Mechanism", t: Array, lam: Array) -> dict[str, Array]:
    """Return ``power.<driver>``, effort times u'(t), in W, (n,) each."""
    rates = driver_rates(mech, t)
    return {f"power.{name}": lam[:, i] * rates[:, i] for name, i in driver_rows(mech).items()}


def driver_rows(mech: "Mechanism") -> dict[str, int]:
    """Return the row of each driver."""
    return {d.name: mech.rows_of(d.name)[0] for d in mech.drivers}


def driver_rates(mech: "Mechanism", t: Array) -> Array:
    """Return the rates u'(t) of the rows of drivers, (n, ng), 0 of other rows."""
    with mech.workspaces.borrowed() as system:
        return np.array([system.constraints.motion(float(x))[1] for x in t]).reshape(len(t), -1)


def brake_rows(mech: "Mechanism") -> dict[str, tuple[int, int]]:
    """Return row and velocity index of each joint with exact dry friction."""
    brakes = [c for c in mech.constraints if isinstance(c, Brake)]
    return {c.name: (mech.rows_of(c.name)[0], find_joint(mech.model, c.joint).idx_v) for c in brakes}


def friction_powers(mech: "Mechanism", v: Array, lam: Array) -> dict[str, Array]:
    """Return ``power.<joint> friction`` in W, (n,) each; lam includes the friction of slipping joints."""
    return {f"power.{name}": lam[:, row] * v[:, i] for name, (row, i) in brake_rows(mech).items()}


def _force_outputs(law: ForceElement, t: float, v: Array, tau: Array) -> list[float]:
    """Return the forces and torques of a law, in the order of their names."""
    if not isinstance(law, PairElement):
        return [float(tau[i]) for i in law.acting_components(len(tau))]
    law.pair.locate()
    wrench = sum((term.F for term in law.wrench_partials(t, law.pair.relative(v))), np.zeros(6))
    force = wrench[:3]
    if law.tension:
        return [-float(force @ unit_gap(law.pair)[1])]
    torque = wrench[3:] - skew(law.pair.pb) @ force
    return [x for vector in (force, torque) for x in (float(np.linalg.norm(vector)), *vector.tolist())]


def named_laws(mech: "Mechanism", laws: ForceElements) -> dict[str, ForceElement]:
    """Return the forces by unique names."""
    used_names = {*joint_names(mech.model), *(c.name for c in mech.constraints)}
    out: dict[str, ForceElement] = {}
    for law in (law for law, _ in laws.bound if law.depends_on_state_only):
        name = f"{law.name} (force)" if law.name in used_names else law.name
        duplicates = sum(other.name == law.name for other in out.values())
        out[f"{name} {duplicates + 1}" if duplicates else name] = law
    return out


def _coordinates(mech: "Mechanism") -> list[tuple[str, str]]:
    """Return name and effort unit of each velocity component, (nv,)."""
    velocities = [(name[2:], unit) for name, unit in coordinate_units(mech).items() if name.startswith("v.")]
    return [(name, "N" if unit == "m/s" else "N m") for name, unit in velocities]
