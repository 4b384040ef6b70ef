"""A mechanism with a rheonomic driver c(q) = t, whose time is the input u of kinematics.

Its rows are those of the closures, one for each locked coordinate and, last, 0 = c(q) - u of the drive.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import qr

from ...errors import InputError, UnknownNameError, as_list, is_number
from ...mechanism import Driver, Mechanism
from ...mechanism.forces import stiction_joints
from ...mechanism.forces.coulomb_friction import CoulombFriction
from ...mechanism.tree.frames import find_joint
from ...mechanism.tree.tree_terms import flexible_bodies
from ...system import Array
from ...tolerances import AMBIGUOUS_PIVOT, RANK, VISIBLE

if TYPE_CHECKING:
    from ...mechanism.formulations.index2 import Index2System

Hold = str | Iterable[str] | Mapping[str, float | None]


def driven_mechanism(mech: Mechanism, drive: str, hold: Hold, q: Array) -> Mechanism:
    """Return the mechanism with ``drive`` as its last driver, u(t) = t, after drivers that lock joints.

    Args:
        mech: the mechanism; further drivers are constant at their values at t = 0.
        drive: a joint of one coordinate, or a driver of the mechanism.
        hold: joints of one coordinate to lock, with values, by default those of q. Flexible bodies keep their shape in
            q, unless one of their modes is named.
        q: configuration, (nq,).

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: for a joint of several coordinates, a joint that is both driven and locked, a locked value that is
            not a finite number, or a further driver whose table does not contain t = 0.
    """
    _check_closures(mech)
    drivers = {d.name: d for d in mech.drivers}
    if drive not in [*drivers, *mech.joint_names]:
        raise UnknownNameError("drive", drive, [*drivers, *single_velocity_joints(mech)])
    values = dict(hold) if isinstance(hold, Mapping) else dict.fromkeys(as_list(hold, "hold is a list of joints"))
    if drive in drivers:
        target, driven = _target(drivers[drive]), drivers[drive].between
    else:
        target, driven = {"joint": drive}, (drive,)
        _coordinate(mech, drive, q)
    values |= dict.fromkeys(_default_modes(mech, {*values, *driven}))
    further = [d for d in mech.drivers if d.name != drive and (d.joint or "") not in (drive, *values)]
    rows = [
        Driver.model_validate({**_target(d), "motion": _constant_position(mech, d, q), "name": d.name}) for d in further
    ]
    rows += [_locking_driver(mech, name, value, q, driven) for name, value in values.items()]
    identity = {"kind": "polynomial", "coefficients": (0.0, 1.0)}
    rows.append(Driver.model_validate({**target, "motion": identity, "name": f"drive {drive}"}))
    closures = [c for c in mech.closures if not c.is_unilateral]
    return Mechanism(
        mech.model, closures, _without_friction(mech), drivers=rows, start=mech.start_values, title=mech.title
    )


def _default_modes(mech: Mechanism, named: set[str]) -> list[str]:
    """Return the modes of the flexible bodies of which no mode is locked or driven."""
    named = named.union(*(d.between for d in mech.drivers))
    bodies = [body for body in flexible_bodies(mech.model) if named.isdisjoint(body.mode_joints)]
    return [name for body in bodies for name in body.mode_joints]


def _check_closures(mech: Mechanism) -> None:
    """Require closures that are always active and have a position level.

    Raises:
        InputError: for a closure that is active in ranges only, or has nonholonomic rows.
    """
    for closure in mech.closures:
        if closure.within:
            within = f"{closure.name!r} is active only in ranges of {closure.within.joint!r}"
            raise InputError(f"{within}: kinematics needs closures that are always active")
        if not (closure.is_unilateral or mech.positional[mech.rows_of(closure.name)].all()):
            raise InputError(
                f"{closure.name!r} has nonholonomic rows: its position depends on the path, not on the input alone"
            )


def _locking_driver(mech: Mechanism, name: str, value: float | None, q: Array, driven: tuple[str, ...]) -> Driver:
    """Return the driver that locks a joint at a value, by default its value in q, (nq,)."""
    if name in driven:
        raise InputError(f"{name!r} is driven: it cannot be locked, too")
    position = _coordinate(mech, name, q)
    if value is not None and not is_number(value):
        raise InputError(f"{name!r} is locked at a finite number in rad or m, got {value!r:.80}")
    return Driver(joint=name, motion=position if value is None else float(value), name=f"hold {name}")


def _without_friction(mech: Mechanism) -> list[Any]:
    return [f for f in mech.forces if not (isinstance(f, CoulombFriction) or stiction_joints(mech.model, [f]))]


def omitted_elements(mech: Mechanism) -> list[str]:
    """Return the names of unilateral closures and of clutches, which `driven_mechanism` omits."""
    return [c.name for c in mech.closures if c.is_unilateral] + [c.name for c in mech.clutches]


def _target(d: Driver) -> dict[str, Any]:
    """Return the joint, joints or frames that a driver moves, by key."""
    return {k: v for k, v in d.model_dump().items() if k not in ("motion", "speed", "name") and v is not None}


def _constant_position(mech: Mechanism, d: Driver, q: Array) -> float:
    """Return the position of a driver at t = 0; for a speed driver, its position in q (nq,)."""
    if d.speed is None:
        if message := d.outside(0.0):
            raise InputError(f"{message}: it is locked at its value at t = 0")
        return d.follow(0.0)[0]
    alone = Mechanism(mech.model, drivers=[Driver.model_validate({**_target(d), "motion": 1.0})])
    return input_at(alone, alone.system(), q)


def input_at(driven: Mechanism, system: "Index2System", q: Array) -> float:
    """Return the input of a driven mechanism at a configuration."""
    any_value = 1.0 if driven.drivers[-1].frames else 0.0  # lengths are positive
    prescribed = driven.drivers[-1].follow(any_value)[0]
    return prescribed + float(system.closures(q, any_value)[0][-1])


def single_velocity_joints(mech: Mechanism) -> list[str]:
    """Return the names of the joints with one velocity, continuous ones included."""
    return [name for name in mech.joint_names if find_joint(mech.model, name).nv == 1]


def _coordinate(mech: Mechanism, name: str, q: Array) -> float:
    joint = find_joint(mech.model, name)
    if joint.nv != 1:
        raise InputError(
            f"joint {name!r} has {joint.nv} coordinates: only joints of one coordinate can be driven or locked"
        )
    x = q[joint.idx_q : joint.idx_q + joint.nq]
    return float(x[0]) if joint.nq == 1 else float(np.arctan2(x[1], x[0]))


def require_one_dof(mech: Mechanism, system: "Index2System", q: Array, drive: str, hold: Iterable[str],
                  omitted: Sequence[str] = ()) -> None:  # fmt: skip
    """Require one degree of freedom at a closed configuration q; messages list locked joints and omitted elements.

    Raises:
        InputError: for no degree of freedom, too many (names joints to lock), a singular q, or a drive that cannot
            move.
    """
    u = input_at(mech, system, q)
    columns = mech.coordinate_scales
    G = system.jacobian(q) * columns / mech.row_scales[:, None]
    rows, e = G[:-1], G[-1]
    left, sigmas, right = np.linalg.svd(rows) if len(rows) else (np.eye(0), np.zeros(0), np.eye(system.nv))
    r = int(np.count_nonzero(sigmas > RANK * sigmas.max(initial=0.0)))
    Z = right[r:].T
    k = int(np.count_nonzero(sigmas > AMBIGUOUS_PIVOT * sigmas.max(initial=0.0)))  # small values may be rounding
    if k < min(rows.shape) and _is_singular(system, G, left[:, k:], right[k:].T):
        raise InputError("the closures lose rank in this pose, in which several branches intersect: start next to it")
    locked = ", ".join(hold)
    if not Z.shape[1]:
        raise InputError(f"no degree of freedom is left for {drive!r}{f' (locked: {locked})' if locked else ''}")
    if Z.shape[1] > 1:
        n = Z.shape[1] - 1
        names = joints_to_lock(mech, Z, e, n)
        advice = f"hold {n} joints besides {drive!r}" + (f", for instance {','.join(names)}" if names else "")
        inactive = f" (inactive: {', '.join(omitted)})" if omitted else ""
        raise InputError(f"{n + 1} degrees of freedom are left{inactive}: {advice}")
    tau = Z[:, 0]
    if abs(e @ tau) < RANK:
        gamma = system.gamma(q, columns * tau, u) / mech.row_scales
        kappa = -np.linalg.lstsq(rows, gamma[:-1], rcond=RANK)[0]
        if abs(gamma[-1] + e @ kappa) < RANK * (1 + np.abs(kappa).max()):
            raise InputError(f"{drive!r} cannot move: the closures and locked joints fix it")


def _is_singular(system: "Index2System", G: Array, left: Array, Z: Array) -> bool:
    """Return whether rows are dependent in this pose only: their second derivative along Z (nv, k) is not 0."""
    for w in left.T:
        if np.abs(Z.T @ constraint_hessian(system, w) @ Z).max() > VISIBLE * np.abs(G).max(initial=1.0):
            return True
    return False


def constraint_hessian(system: "Index2System", left: Array) -> Array:
    """Return d(G^T left)/dq, (nv, nv), at the last evaluated configuration, in characteristic lengths.

    Args:
        system: a workspace of a driven mechanism.
        left: coefficients of all rows except the driver's, (ng - 1,).
    """
    columns, rows = system.mechanism.coordinate_scales, system.mechanism.row_scales
    K = system.constraints.partials(np.zeros(system.nv), np.append(left, 0.0) / rows)[0]
    return np.asarray(columns[:, None] * K * columns)


def joints_to_lock(mech: Mechanism, Z: Array, e: Array, n: int) -> list[str]:
    """Return n joints of one coordinate to lock so that only the drive can move, preferably prismatic and actuated."""
    along = Z.T @ e
    if not np.abs(along).max() > RANK:
        return []
    Q = np.linalg.svd(along[None])[2][1:] @ Z.T  # motions while the drive is fixed
    names = single_velocity_joints(mech)
    actuated = {str(getattr(f, "joint", "")) for f in mech.forces}
    preference = [1.0 + (mech.joint_kind(j).startswith("P") or j in actuated) for j in names]
    columns = Q[:, [find_joint(mech.model, j).idx_v for j in names]] * np.array(preference)
    diagonal, order = qr(columns, mode="r", pivoting=True)
    if len(names) < n or abs(diagonal[n - 1, n - 1]) < VISIBLE:
        return []
    return sorted((names[i] for i in order[:n]), key=names.index)
