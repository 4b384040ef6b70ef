"""Forces and torques in every joint of the tree, from Newton's and Euler's equations body by body.

The wrench of a joint acts on the body behind it, and its opposite on the body before it. It is all that goes through
the joint: what the bearing carries, and what springs, motors and drivers of the joint do along its axes,

    f_j = sum over bodies k behind j of (I_k a_k + v_k x* I_k v_k - weight_k - wrenches of closures and forces on k).

So S_j^T f_j + armature v'_j is the torque of all that acts in the joint. Which joint of a loop was cut does not
matter: a closure's wrench, see `mbdae.mechanism.reactions`, is what its joint in the tree would have.
"""

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ..system import Array
from .forces.force import PairElement

if TYPE_CHECKING:
    from .formulations.index2 import Index2System


def joint_wrenches(
    system: "Index2System", t: float, q: Array, v: Array, vdot: Array, lam: Array, *, laws: bool = True
) -> Array:
    """Return the wrenches of all joints, force and then torque, in the joint's own axes and at its origin, (nj, 6).

    Args:
        system: a workspace.
        t: time.
        q: configuration, (nq,).
        v: velocity, (nv,).
        vdot: acceleration, (nv,).
        lam: multipliers of all rows, (ng,).
        laws: with the forces between frames, weight and inertia; else those of the multipliers alone.
    """
    model, data = system.model, system.data
    system.jacobian(q)
    outer = np.zeros((model.njoints, 6))
    for name, part in system.constraints.frame_parts.items():
        rows = system.constraints.spans[name]
        _add(outer, part.pair, system.constraints.W[:, rows] @ lam[rows])
    if laws:
        if not system.ng:
            pin.computeJointJacobians(model, data, q)
        for law, _ in system.laws.bound:
            if isinstance(law, PairElement):
                law.pair.locate()
                for turning in law.turning(t, law.pair.relative(v)):
                    _add(outer, law.pair, turning.F)
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
