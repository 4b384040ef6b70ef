"""Transmission angle of any mechanism: the angle that determines how much of the coupler force moves the output link.

A unit load on the output is balanced at the input, without gravity: G^T lam = -e_out - c e_in. With the reaction force
F at the moving pin of the output link and the velocity v_P of that pin, sin mu = |F . v_P| / (|F| |v_P|). In a four-bar
linkage mu is the angle between coupler and rocker.
"""

import numpy as np

from ...errors import InputError
from ...mechanism import Mechanism
from ...mechanism.closures.independent_rows import minimum_norm
from ...mechanism.formulations.index2 import Index2System
from ...mechanism.signals.joint_wrenches import joint_wrenches
from ...mechanism.tree.frames import find_joint, support
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING, ZERO_SPEED


def default_output(mech: Mechanism, drive: str, locked: list[str]) -> str | None:
    """Return the only ground joint that is neither driven nor locked; None for several, or several coordinates."""
    found = [
        n for n in mech.joint_names if mech.model.parents[mech.model.getJointId(n)] == 0 and n not in (drive, *locked)
    ]
    return found[0] if len(found) == 1 and find_joint(mech.model, found[0]).nv == 1 else None


def transmission(
    mech: Mechanism, system: Index2System, q: Array, tangent: Array, at_branch_point: Array, output: str
) -> Array:
    """Return the transmission angle at an output joint in rad, from 0 to pi/2, (n,); nan where no force is transmitted.

    Args:
        mech: the mechanism.
        system: a workspace of the mechanism with the driver as the last row.
        q: configurations, (n, nq).
        tangent: tangents of the curve, (n, nv).
        at_branch_point: mask of the branch points, for which the angle is nan, (n,).
        output: a joint of one coordinate.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: for a joint of several coordinates.
    """
    joint = find_joint(mech.model, output)
    if joint.nv != 1:
        raise InputError(f"the output {output!r} has {joint.nv} coordinates: a transmission angle needs one")
    body, load, zero = joint.id, np.zeros(mech.nv), np.zeros(mech.nv)
    coordinate_scales, row_scales = mech.coordinate_scales, system.mechanism.row_scales
    load[joint.idx_v] = 1.0
    pairs = {name: bound.pair for name, bound in system.constraints.frame_rows.items()}
    ends = [(n, p, 1.0 if p.b.joint == body else -1.0) for n, p in pairs.items() if body in (p.a.joint, p.b.joint)]
    children = [j for j in range(1, mech.model.njoints) if mech.model.parents[j] == body]
    out, moving = np.full(len(q), np.nan), support(mech.model, body)
    if len(ends) + len(children) != 1:
        return out
    for i, (pose, direction) in enumerate(zip(q, tangent, strict=True)):
        G = system.jacobian(pose) * coordinate_scales / row_scales[:, None]
        if at_branch_point[i]:
            continue
        if abs(G[-1] @ (direction / coordinate_scales)) < ZERO_SPEED:  # a dead point: the load is negligible
            lam = np.append(minimum_norm(G[:-1], mech.nv - 1, -G[-1]), 0.0)
        else:
            lam = minimum_norm(G, mech.nv, -load)
        lam /= row_scales
        if ends:
            name, pair, sign = ends[0]
            rows = system.constraints.spans[name]
            force, point = sign * (system.constraints.W[:, rows] @ lam[rows])[:3], pair.pb
        else:
            wrench = joint_wrenches(system, 0.0, pose, zero, zero, lam, laws=False)
            placement = system.workspace.oMi[children[0]]
            force, point = -placement.rotation @ wrench[children[0] - 1, :3], placement.translation.copy()
        V = system.workspace.J.reshape(6, -1) @ (direction * moving)
        v_pin = V[:3] + np.cross(V[3:], point)
        sizes = np.linalg.norm(force) * np.linalg.norm(v_pin)
        if sizes > SOLUTION_ROUNDING:
            out[i] = np.arcsin(min(1.0, abs(force @ v_pin) / sizes))
    return out
