"""Derivatives of joint and closure wrenches, from the Newton-Euler equations of each body.

With the inertia Y of a body, A' = A - gravity and h = Y V, body-fixed quantities are displaced by X, and the remaining
changes of velocity and acceleration are dV~ = dV - X x V, dA~ = dA' - X x A',

    F = Y A' + V x* h - outer,   dF = X x* (F + outer) + Y dA~ + dV~ x* h + V x* Y dV~ + dY - d outer

and a joint's wrench is the sum over the bodies of its subtree, see `mbdae.mechanism.signals.joint_wrenches`.
"""

import numpy as np
import pinocchio as pin

from ...system import Array
from ..forces.force import PairElement
from ..signals.joint_wrenches import reaction_names
from ..tree.frames import cross, joint_names, motion_cross, point_velocities
from .motion_tangent import MotionTangent
from .wrenches import closure_wrench, law_wrench, wrench_cross


def reaction_derivatives(motion: MotionTangent) -> tuple[Array, Array]:
    """Return `mbdae.mechanism.signals.joint_wrenches.point_reactions`, (2, n, 2, 3), and its tangents (2, n, 2, 3, m).

    The first index selects world axes or local axes, the third one selects force or torque.
    """
    names, joints, m = reaction_names(motion.mechanism), joint_names(motion.model), len(motion.d.t)
    closures = {name: closure_wrench(motion, name) for name in motion.system.constraints.frame_rows}
    F, dF = _joints(motion, closures)
    values, derivatives = np.empty((2, len(names), 6)), np.empty((2, len(names), 6, m))
    for i, name in enumerate(names):
        if name in closures:
            pair = motion.system.constraints.frame_rows[name].pair
            (w, dw), (X_axes, X), p, R = closures[name], motion.pair(pair), pair.pb, pair.Ra
        else:
            j = joints.index(name) + 1
            w, dw, X, X_axes = F[j], dF[j], motion.X[j], motion.X[j]
            p, R = motion.placements[j].translation, motion.placements[j].rotation
        world = np.concatenate([w[:3], w[3:] - cross(p, w[:3])])
        lever = cross(point_velocities(X, p), w[:3, None]) + cross(p[:, None], dw[:3])
        dworld = np.concatenate([dw[:3], dw[3:] - lever])
        values[0, i], derivatives[0, i] = world, dworld
        for span in (slice(0, 3), slice(3, 6)):  # force and torque
            values[1, i, span] = R.T.dot(world[span])
            derivatives[1, i, span] = R.T.dot(dworld[span] - cross(X_axes[3:], world[span][:, None]))
    return values.reshape(2, -1, 2, 3), derivatives.reshape(2, -1, 2, 3, m)


def _joints(motion: MotionTangent, closures: dict[str, tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return the wrenches in all joints about the world's origin, (njoints, 6), and their tangents, (njoints, 6, m)."""
    model, parameters, d = motion.model, motion.parameters, motion.d
    F, dF = np.zeros((model.njoints, 6)), np.zeros((model.njoints, 6, len(d.t)))
    outer = [(motion.system.constraints.frame_rows[name].pair, *found) for name, found in closures.items()]
    for index, (law, _) in enumerate(motion.system.laws.bound):
        if isinstance(law, PairElement):
            outer.append((law.pair, *law_wrench(motion, law, index)))
    for pair, w, dw in outer:
        for joint, sign in ((pair.b.joint, -1.0), (pair.a.joint, 1.0)):
            F[joint] += sign * w
            dF[joint] += sign * dw
    for j in range(1, model.njoints):
        pose, Y, X, V = motion.placements[j], model.inertias[j], motion.X[j], motion.V[j]
        A = pin.Motion(motion.A[j]) - model.gravity
        inertia, h = pose.act(Y), (pose.act(Y) * pin.Motion(V)).vector
        wrench = (inertia * A).vector + wrench_cross(V[:, None], h[:, None])[:, 0]
        dV = motion.dV[j] - motion_cross(X, V[:, None])
        dA = motion.dA[j] - motion_cross(X, A.vector[:, None])
        for p, dp in zip(parameters.all, d.p, strict=True):
            dA[:3] -= np.outer(p.gravity, dp)
            if j in p.inertias:
                local = pose.actInv(pin.Motion(V)), pose.actInv(A)
                dF[j] += np.outer(pose.act(pin.Force(pin.bodyRegressor(*local) @ p.inertias[j])).vector, dp)
        F[j] += wrench
        Y_dV = inertia.matrix().dot(dV)
        dF[j] += wrench_cross(X, wrench[:, None]) + inertia.matrix().dot(dA)
        dF[j] += wrench_cross(dV, h[:, None]) + wrench_cross(V[:, None], Y_dV)
    for j in range(model.njoints - 1, 0, -1):
        F[model.parents[j]] += F[j]
        dF[model.parents[j]] += dF[j]
    return F, dF
