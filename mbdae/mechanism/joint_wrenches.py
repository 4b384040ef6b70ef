"""Forces and torques in every joint of the tree, from Newton's and Euler's equations body by body.

The wrench of a joint acts on its child body, and its opposite on the parent body. It is the total load through the
joint: the bearing reaction, and springs, motors and drivers of the joint along its axes,

    f_j = sum over the bodies k of j's subtree of (I_k a_k + v_k x* I_k v_k - weight_k - other wrenches on k),

with the wrenches of closures and forces on k.

Hence S_j^T f_j + armature v'_j is the total joint torque. The choice of the cut joint of a loop does not matter: a
closure's wrench, see `mbdae.mechanism.reactions`, equals that of a tree joint in its place, including its friction.
"""

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..system import Array
from ..tolerances import VISIBLE
from .forces.force import PairElement
from .frames import joint_names, skew
from .reactions import Reaction, null_rows, sampled

if TYPE_CHECKING:
    from .formulations.index2 import Index2System
    from .mechanism import Mechanism


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
        laws: include the forces between frames, weight and inertia; otherwise those of the multipliers alone.
    """
    model, data = system.model, system.workspace
    system.jacobian(q)
    outer = np.zeros((model.njoints, 6))
    for name, part in system.constraints.frame_parts.items():
        rows = system.constraints.spans[name]
        friction = system.sliding.wrench(name, v, lam) if laws else 0.0
        _add(outer, part.pair, system.constraints.W[:, rows] @ lam[rows] + friction)
    if laws:
        if not system.ng:
            pin.computeJointJacobians(model, data, q)
        for law, _ in system.laws.bound:
            if isinstance(law, PairElement):
                law.pair.locate()
                for term in law.wrench_partials(t, law.pair.relative(v)):
                    _add(outer, law.pair, term.F)
    forces = pin.StdVec_Force()
    for place, wrench in zip(data.oMi, outer, strict=True):
        forces.append(place.actInv(pin.Force(wrench)))
    if laws:
        pin.rnea(model, data, q, v, vdot, forces)
        return _read(data)
    still = np.zeros(model.nv)
    pin.rnea(model, data, q, still, still)
    weight = _read(data)
    pin.rnea(model, data, q, still, still, forces)
    return _read(data) - weight


def _add(outer: Array, pair: "object", wrench: Array) -> None:
    outer[pair.b.joint] += wrench  # type: ignore[attr-defined]
    outer[pair.a.joint] -= wrench  # type: ignore[attr-defined]


def _read(data: pin.Data) -> Array:
    return np.array([f.vector for f in data.f[1:]])


def joint_reaction(mech: "Mechanism", name: str, *motion: Array) -> Reaction:
    """Return the wrench of a tree joint on its child body, at the joint origin, as a `Reaction`.

    Args:
        mech: the mechanism.
        name: name of the joint; its axes are those of the child body.
        motion: t, q, v, v' and lam as for `reaction_wrenches`.
    """
    world, own = (x[:, reaction_names(mech).index(name)] for x in reaction_wrenches(mech, *motion))
    t, q, v, vdot, _ = motion
    system, j, known = mech.system(), joint_names(mech.model).index(name), np.ones(6, bool)
    for i in sampled(len(t)) if mech.ng else ():
        for combination in null_rows(system, t[i], q[i]).T:
            wrench = joint_wrenches(system, t[i], q[i], v[i], vdot[i], combination, laws=False)[j]
            known &= np.abs(wrench) < VISIBLE
    return Reaction(name, np.asarray(t), own[:, :3], own[:, 3:], world[:, :3], world[:, 3:], tuple(known.tolist()))


def reaction_names(mech: "Mechanism") -> list[str]:
    """Return names of all that transmits wrenches: tree joints, and closures and drivers between frames.

    A closure has precedence over a joint of the same name.
    """
    between = [c.name for c in mech.constraints if c.frames]
    return [name for name in joint_names(mech.model) if name not in between] + between


def reaction_wrenches(mech: "Mechanism", t: Array, q: Array, v: Array, vdot: Array, lam: Array) -> tuple[Array, Array]:
    """Return the wrenches of all `reaction_names`, (n, k, 6), in world axes and in local axes.

    A joint's wrench acts on its child body, at the joint's origin, and its local axes are those of that body; a
    closure's acts on the body of its second frame, at that frame's origin, and its local axes are those of the first
    frame.

    Args:
        mech: the mechanism.
        t: times, (n,).
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        vdot: accelerations, (n, nv).
        lam: multipliers of all rows, (n, ng).
    """
    system = mech.system()
    world, own = np.full((2, len(t), len(reaction_names(mech)), 6), np.nan)
    for i in range(len(t)):
        if np.isfinite(lam[i]).all() and np.isfinite(vdot[i]).all():
            world[i], own[i] = point_reactions(system, t[i], q[i], v[i], vdot[i], lam[i])
    return world, own


def point_reactions(
    system: "Index2System", t: float, q: Array, v: Array, vdot: Array, lam: Array
) -> tuple[Array, Array]:
    """Return `reaction_wrenches` at one point, (k, 6) each."""
    names = reaction_names(system.mechanism)
    parts, joints = system.constraints.frame_parts, joint_names(system.model)
    world, own = np.zeros((2, len(names), 6))
    wrenches = joint_wrenches(system, t, q, v, vdot, lam)
    for k, name in enumerate(names):
        if name in parts:
            pair, rows = parts[name].pair, system.constraints.spans[name]
            w = system.constraints.W[:, rows] @ lam[rows] + system.sliding.wrench(name, v, lam)
            w[3:] -= skew(pair.pb) @ w[:3]
            world[k], own[k] = w, (w.reshape(2, 3) @ pair.Ra).ravel()
        else:
            j = joints.index(name)
            own[k] = wrenches[j]
            world[k] = (wrenches[j].reshape(2, 3) @ system.workspace.oMi[j + 1].rotation.T).ravel()
    return world, own
