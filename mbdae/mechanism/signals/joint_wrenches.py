"""Forces and torques in every joint of the tree, from Newton's and Euler's equations body by body.

The wrench of a joint acts on its child body, and its opposite on the parent body. It is the total load through the
joint: the bearing reaction, and springs, motors and drivers of the joint along its axes,

    f_j = sum over the bodies k of j's subtree of (I_k a_k + v_k x* I_k v_k - weight_k - other wrenches on k),

where the other wrenches are exerted by closures and forces.

Hence S_j^T f_j + armature v'_j is the total joint torque. The choice of the cut joint of a loop does not matter: the
wrench of a closure, see `mbdae.mechanism.signals.reactions`, equals the wrench of a tree joint in its place, including
friction.
"""

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...system import Array
from ...tolerances import VISIBLE
from ..forces.force import PairElement
from ..tree.frames import Pair, joint_names, skew
from ..tree.tree_terms import bound_bodies, flexible_bodies, update_motions, update_poses
from .reactions import Reaction, multiplier_null_space, sample_indices

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism


def joint_wrenches(
    system: "Index2System", t: float, q: Array, v: Array, vdot: Array, lam: Array, *, laws: bool = True
) -> Array:
    """Return the wrenches of all joints, force and then torque, in the joint frame and at its origin, (nj, 6).

    Args:
        system: a workspace.
        t: time.
        q: configuration, (nq,).
        v: velocity, (nv,).
        vdot: acceleration, (nv,).
        lam: multipliers of all rows, (ng,).
        laws: include the forces between frames, weight and inertia; if false, return only the effect of multipliers.
    """
    model, data = system.model, system.workspace
    system.jacobian(q)
    external = np.zeros((len(data.oMi), 6))
    for name, bound in system.constraints.frame_rows.items():
        rows = system.constraints.spans[name]
        friction = system.closure_friction.wrench(name, v, lam) if laws else 0.0
        _add(external, bound.pair, system.constraints.W[:, rows] @ lam[rows] + friction)
    if laws:
        if not system.ng:
            update_poses(model, data, q)
        for law, _ in system.laws.bound:
            if isinstance(law, PairElement):
                law.pair.locate()
                for term in law.wrench_partials(t, law.pair.relative(v)):
                    _add(external, law.pair, term.F)
    if bound_bodies(data):
        _add_flexible_wrenches(system, external, q, v, vdot, inertia=laws)
    forces = pin.StdVec_Force()
    for placement, wrench in zip(data.oMi[: model.njoints], external[: model.njoints], strict=True):
        forces.append(placement.actInv(pin.Force(wrench)))
    if laws:
        pin.rnea(model, data, q, v, vdot, forces)
        return _joint_forces(data)
    zero = np.zeros(model.nv)
    pin.rnea(model, data, q, zero, zero)
    weight = _joint_forces(data)
    pin.rnea(model, data, q, zero, zero, forces)
    return _joint_forces(data) - weight


def _add_flexible_wrenches(
    system: "Index2System", external: Array, q: Array, v: Array, vdot: Array, *, inertia: bool
) -> None:
    """Add the wrenches on nodes, and the inertia wrenches of the deformation, to the frames of flexible bodies."""
    data, gravity = system.workspace, system.model.gravity.linear
    update_motions(system.model, data, q, v, vdot)
    for body in bound_bodies(data):
        external[body.joint] += external[[node.index for node in body.nodes]].sum(axis=0)
        if inertia:
            external[body.joint] -= body.inertia_wrench(data, q, v, vdot, gravity)


def _add(external: Array, pair: Pair, wrench: Array) -> None:
    external[pair.b.joint] += wrench
    external[pair.a.joint] -= wrench


def _joint_forces(data: pin.Data) -> Array:
    return np.array([f.vector for f in data.f[1:]])


def joint_reaction(mech: "Mechanism", name: str, *motion: Array) -> Reaction:
    """Return the wrench of a tree joint on its child body, at the joint origin, as a `Reaction`.

    Args:
        mech: the mechanism.
        name: name of the joint; components are in axes of the child body.
        motion: t, q, v, v' and lam as for `reaction_wrenches`.
    """
    world, local = (x[:, reaction_names(mech).index(name)] for x in reaction_wrenches(mech, *motion))
    t, q, v, vdot, _ = motion
    j, unique = joint_names(mech.model).index(name), np.ones(6, bool)
    with mech.workspaces.borrowed() as system:
        for i in sample_indices(len(t)) if mech.ng else ():
            for combination in multiplier_null_space(system, t[i], q[i]).T:
                wrench = joint_wrenches(system, t[i], q[i], v[i], vdot[i], combination, laws=False)[j]
                unique &= np.abs(wrench) < VISIBLE
    axes = local[:, :3], local[:, 3:], world[:, :3], world[:, 3:]
    return Reaction(name, np.asarray(t), *axes, tuple(unique.tolist()))


def reaction_names(mech: "Mechanism") -> list[str]:
    """Return the names of all elements that transmit a wrench: tree joints, closures and drivers between frames.

    A closure has precedence over a joint of the same name.
    """
    constraints = [c.name for c in mech.constraints if c.frames]
    excluded = {*constraints, *(name for body in flexible_bodies(mech.model) for name in body.mode_joints)}
    return [name for name in joint_names(mech.model) if name not in excluded] + constraints


def reaction_wrenches(mech: "Mechanism", t: Array, q: Array, v: Array, vdot: Array, lam: Array) -> tuple[Array, Array]:
    """Return the wrenches of all `reaction_names`, (n, k, 6), in world axes and in local axes.

    The wrench of a joint acts on its child body, at the joint's origin, with local axes of that body; the wrench of a
    closure acts on the body of its second frame, at that frame's origin, with local axes of the first frame.

    Args:
        mech: the mechanism.
        t: times, (n,).
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        vdot: accelerations, (n, nv).
        lam: multipliers of all rows, (n, ng).
    """
    world, local = np.full((2, len(t), len(reaction_names(mech)), 6), np.nan)
    with mech.workspaces.borrowed() as system:
        for i in range(len(t)):
            if np.isfinite(lam[i]).all() and np.isfinite(vdot[i]).all():
                world[i], local[i] = point_reactions(system, t[i], q[i], v[i], vdot[i], lam[i])
    return world, local


def point_reactions(
    system: "Index2System", t: float, q: Array, v: Array, vdot: Array, lam: Array
) -> tuple[Array, Array]:
    """Return `reaction_wrenches` at one point, (k, 6) each."""
    names = reaction_names(system.mechanism)
    bound, joints = system.constraints.frame_rows, joint_names(system.model)
    world, local = np.zeros((2, len(names), 6))
    wrenches = joint_wrenches(system, t, q, v, vdot, lam)
    for k, name in enumerate(names):
        if name in bound:
            pair, rows = bound[name].pair, system.constraints.spans[name]
            w = system.constraints.W[:, rows] @ lam[rows] + system.closure_friction.wrench(name, v, lam)
            w[3:] -= skew(pair.pb) @ w[:3]
            world[k], local[k] = w, (w.reshape(2, 3) @ pair.Ra).ravel()
        else:
            j = joints.index(name)
            local[k] = wrenches[j]
            world[k] = (wrenches[j].reshape(2, 3) @ system.workspace.oMi[j + 1].rotation.T).ravel()
    return world, local
