"""Actuators of inverse dynamics: joints and drivers, and the coordinates that they act on."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...errors import InputError, UnknownNameError, as_list, is_number, require
from ...mechanism import Driver, Mechanism
from ...mechanism.forces.dc_motor import DCMotor
from ...mechanism.forces.joint_pid import JointPID
from ...mechanism.forces.joint_torque import JointTorque
from ...mechanism.tree.coordinate_units import component_suffixes, coordinate_units, effort_unit
from ...mechanism.tree.frames import find_joint
from ...system import Array

REPLACED_FORCES = (JointPID, JointTorque, DCMotor)  # forces that actuators replace


class Actuators(NamedTuple):
    """Actuators with m efforts.

    Attributes:
        mechanism: mechanism without the forces that actuators replace; drivers are its last rows.
        names: names of the efforts.
        units: units of the efforts, ``"N m"`` or ``"N"``.
        joint_rows: rows of S that belong to joints, (m, nv); zero for drivers.
        driver_rows: for each effort the row of G of its driver, -1 for joints.
        undriven: indices of the rows that are not drivers, (c,).
        replaced: names of the replaced forces.
    """

    mechanism: Mechanism
    names: list[str]
    units: list[str]
    joint_rows: Array
    driver_rows: list[int]
    undriven: Array
    replaced: tuple[str, ...]

    def rows_at(self, G: Array) -> Array:
        """Return S (m, nv), whose generalized force is S^T effort, for G (ng, nv) of all rows."""
        out = self.joint_rows.copy()
        for i, row in enumerate(self.driver_rows):
            if row >= 0:
                out[i] = G[row]
        return out


class _Effort(NamedTuple):
    """One effort: its name and unit, its row S (nv,), and the row of G of its driver, -1 for joints."""

    name: str
    unit: str
    joint_row: Array
    driver_row: int


class _Candidates:
    """Possible actuators by name: drivers, and joints with controllers, torques or motors."""

    def __init__(self, mech: Mechanism) -> None:
        self.mech = mech
        self.drivers = {d.name: d for d in mech.drivers}
        self.driven = {d.joint: d for d in reversed(mech.drivers)}
        forces = {f.name: f.joint for f in mech.forces if isinstance(f, REPLACED_FORCES)}
        motors = {m.name: m.joint for m in mech.motors}
        self.joints = motors | forces
        self.default = list(self.drivers) or list(dict.fromkeys([*forces.values(), *motors.values()]))
        self.names = dict.fromkeys([*self.drivers, *forces, *motors, *mech.joint_names])

    def chosen(self, names: str | Sequence[str] | None, drive: str) -> list[str]:
        """Return the names of the requested actuators, or the default ones.

        Raises:
            InputError: if none are given and the mechanism has none.
        """
        if names is not None:
            return as_list(names, "actuators is a list of joints and drivers")
        chosen = [drive] if drive else self.default
        if not chosen:
            raise InputError(f"{self.mech.title!r} has no drivers or motors: name the joints that are actuated")
        return chosen

    def driver(self, name: str) -> Driver | None:
        """Return the driver with this name, unless it drives one joint."""
        driver = self.drivers.get(name)
        return None if driver is None or driver.joint else driver

    def joint(self, name: str) -> str:
        """Return the joint on which the actuator with this name acts.

        Raises:
            UnknownNameError: for a name that does not exist.
        """
        driver = self.drivers.get(name) or self.driven.get(name)
        joint = driver.joint if driver else self.joints.get(name)
        joint = joint or name
        if joint not in self.mech.joint_names:
            raise UnknownNameError("actuator", name, self.names)
        return joint


def actuators_of(mech: Mechanism, names: str | Sequence[str] | None, drive: str = "") -> Actuators:
    """Return the actuators by name; by default the input, else all drivers, else joints with motors or controllers.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: if there is none.
    """
    candidates = _Candidates(mech)
    chosen = candidates.chosen(names, drive)
    found: list[_Effort] = []
    joints: set[str] = set()
    for name in chosen:
        if driver := candidates.driver(name):
            found.append(_driver_effort(mech, driver, name))
            continue
        joint = candidates.joint(name)
        joints.add(joint)
        found += _joint_efforts(mech, joint, name)
    if len({effort.name for effort in found}) < len(found) or not found:
        raise InputError(f"actuators are named once each, got {', '.join(chosen) or 'none'}")
    labels, units, joint_rows, driver_rows = zip(*found, strict=True)
    driven = [row for d in mech.drivers for row in mech.rows_of(d.name)]
    undriven = np.setdiff1d(np.arange(mech.ng), driven)
    replaced = [f for f in mech.forces if isinstance(f, REPLACED_FORCES) and f.joint in joints]
    return Actuators(
        _without_forces(mech, replaced), list(labels), list(units), np.array(joint_rows), list(driver_rows), undriven,
        tuple(f.name for f in replaced),
    )  # fmt: skip


def _without_forces(mech: Mechanism, replaced: Sequence[object]) -> Mechanism:
    """Return the mechanism without some of its forces."""
    forces = [f for f in mech.forces if f not in replaced]
    return Mechanism(
        mech.model, mech.closures, forces, drivers=mech.drivers, stops=mech.stops, clutches=mech.clutches,
        title=mech.title, start=mech.start_values,
    )  # fmt: skip


def _driver_effort(mech: Mechanism, driver: Driver, name: str) -> _Effort:
    unit = "N" if driver.frames else effort_unit(coordinate_units(mech), driver.between[0])
    return _Effort(name, unit, np.zeros(mech.nv), mech.rows_of(driver.name)[0])


def _joint_efforts(mech: Mechanism, joint: str, name: str) -> list[_Effort]:
    first, units = find_joint(mech.model, joint).idx_v, coordinate_units(mech)
    return [
        _Effort(name + x, "N" if units[f"v.{joint}{x}"] == "m/s" else "N m", np.eye(mech.nv)[first + i], -1)
        for i, x in enumerate(component_suffixes(mech, joint)[1])
    ]


def effort_weights(names: Sequence[str], weights: Mapping[str, float] | None) -> Array:
    """Return weights of the squares of efforts, (m,), 1 by default.

    Raises:
        UnknownNameError: for a name that is not an effort.
        InputError: for a weight that is not a positive number.
    """
    out = np.ones(len(names))
    require(weights or {}, Mapping, "weights are a table, effort = number")
    for name, value in (weights or {}).items():
        if name not in names:
            raise UnknownNameError("actuator", name, names)
        if not (is_number(value) and value > 0):
            raise InputError(f"the weight of {name!r} must be a positive number, got {value!r}")
        out[list(names).index(name)] = value
    return out
