"""Which joints and drivers shall bring a motion about, and what they act on."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...errors import InputError, UnknownNameError, as_list
from ...mechanism import Mechanism
from ...mechanism.coordinate_units import coordinate_units, effort_unit
from ...mechanism.forces.dc_motor import DCMotor
from ...mechanism.forces.joint_pid import JointPID
from ...mechanism.forces.joint_torque import JointTorque
from ...mechanism.frames import find_joint
from ...system import Array

ACTING = (JointPID, JointTorque, DCMotor)  # forces in whose place actuators are


class Actuators(NamedTuple):
    """What acts, m efforts in all.

    Attributes:
        mechanism: without the forces that actuators replace; drivers are its last rows.
        names: of the efforts.
        units: ``"N m"`` or ``"N"``.
        fixed: rows of joints, (m, nv); zero for those that are drivers.
        rows: for each effort the row of G of its driver, -1 for joints.
        carrying: numbers of the rows that are no drivers, (c,).
    """

    mechanism: Mechanism
    names: list[str]
    units: list[str]
    fixed: Array
    rows: list[int]
    carrying: Array

    def at(self, G: Array) -> Array:
        """The rows S of all efforts, (m, nv): they act with S^T effort; G (ng, nv) has all rows."""
        out = self.fixed.copy()
        for i, row in enumerate(self.rows):
            if row >= 0:
                out[i] = G[row]
        return out


def actuators_of(mech: Mechanism, names: str | Sequence[str] | None, drive: str = "") -> Actuators:
    """Find the actuators by name; when left out the drive, all drivers, joints with motors or controllers.

    Raises:
        UnknownNameError: for a name that does not exist.
        InputError: where there is none.
    """
    drivers = {d.name: d for d in mech.drivers}
    forces = {f.name: f.joint for f in mech.forces if isinstance(f, ACTING)}
    motors = {m.name: m.joint for m in mech.motors}
    if names is None:
        chosen = [drive] if drive else [*drivers] or list(dict.fromkeys([*forces.values(), *motors.values()]))
        if not chosen:
            raise InputError(f"{mech.title!r} has no drivers and motors: name the joints that are actuated")
    else:
        chosen = as_list(names, "actuators is a list of joints and drivers")
    found: list[tuple[str, str, Array, int]] = []
    joints: set[str] = set()
    for name in chosen:
        driver = drivers.get(name) or next((d for d in mech.drivers if d.joint == name), None)
        if driver is not None and not driver.joint:
            kind = "N" if driver.frames else effort_unit(coordinate_units(mech), driver.between[0])
            found.append((name, kind, np.zeros(mech.nv), mech.rows_of(driver.name)[0]))
            continue
        joint = (driver.joint if driver else None) or forces.get(name) or motors.get(name) or name
        if joint not in mech.joint_names:
            raise UnknownNameError("actuator", name, dict.fromkeys([*drivers, *forces, *motors, *mech.joint_names]))
        joints.add(joint)
        found += _of_joint(mech, joint, name)
    if len({n for n, *_ in found}) < len(found) or not found:
        raise InputError(f"actuators are named once each, got {', '.join(chosen) or 'none'}")
    kept = [f for f in mech.forces if not (isinstance(f, ACTING) and f.joint in joints)]
    bound = Mechanism(
        mech.model, mech.closures, kept, drivers=mech.drivers, stops=mech.stops, clutches=mech.clutches,
        title=mech.title, start=mech.start_values,
    )  # fmt: skip
    labels, kinds, rows, numbers = zip(*found, strict=True)
    driven = [row for d in mech.drivers for row in mech.rows_of(d.name)]
    carrying = np.setdiff1d(np.arange(mech.ng), driven)
    return Actuators(bound, list(labels), list(kinds), np.array(rows), list(numbers), carrying)


def _of_joint(mech: Mechanism, joint: str, name: str) -> list[tuple[str, str, Array, int]]:
    j, out = find_joint(mech.model, joint), []
    every = [n for n in coordinate_units(mech) if n.startswith("v.")]
    columns = [n for n in every if n[2:] == joint or n.startswith(f"v.{joint}.")]
    for i in range(j.nv):
        row = np.zeros(mech.nv)
        row[j.idx_v + i] = 1.0
        part = columns[i][2 + len(joint) :] if j.nv > 1 else ""
        unit = "N" if len(columns) == j.nv and coordinate_units(mech)[columns[i]] == "m/s" else "N m"
        out.append((name + part, unit, row, -1))
    return out


def weights_of(names: Sequence[str], weights: Mapping[str, float] | None) -> Array:
    """Weights of the squares of efforts, (m,), 1 where nothing is said.

    Raises:
        UnknownNameError: for a name that is no effort.
        InputError: for a weight that is not positive.
    """
    out = np.ones(len(names))
    for name, value in (weights or {}).items():
        if name not in names:
            raise UnknownNameError("actuator", name, names)
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"the weight of {name!r} must be a positive number, got {value!r}")
        out[list(names).index(name)] = value
    return out
