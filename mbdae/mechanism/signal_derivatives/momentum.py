"""Directional derivatives of the centre of mass, the momenta and the shaking force."""

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.frames import motion_cross, point_velocities
from .motion_tangent import MotionTangent
from .wrenches import wrench_cross


def momentum_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives in m directions of the columns of `mbdae.mechanism.signals.momentum.momentum`, (9, m)."""
    m, d = len(motion.d.t), motion.d
    mass, first_moment, h = 0.0, np.zeros(3), np.zeros(6)  # sums of m, m c and momenta about the world's origin
    dmass, dfirst_moment, dh = np.zeros(m), np.zeros((3, m)), np.zeros((6, m))
    for j, Y in enumerate(motion.model.inertias):
        if not j:
            continue
        pose, X, V, dV = motion.placements[j], motion.X[j], motion.V[j], motion.dV[j]
        inertia, c, V_local = pose.act(Y), pose.act(Y.lever), pose.actInv(pin.Motion(V))
        momentum = (inertia * pin.Motion(V)).vector
        mass, first_moment, h = mass + Y.mass, first_moment + Y.mass * c, h + momentum
        dfirst_moment += Y.mass * point_velocities(X, c)
        dh += wrench_cross(X, momentum[:, None]) + inertia.matrix().dot(dV - motion_cross(X, V[:, None]))
        for p, dp in zip(motion.parameters.all, d.p, strict=True):
            if j in p.inertias:
                x = p.inertias[j]
                dmass += x[0] * dp
                dfirst_moment += np.outer(x[0] * pose.translation + pose.rotation.dot(x[1:4]), dp)
                dh += np.outer(pose.act(pin.Force(pin.bodyRegressor(pin.Motion.Zero(), V_local) @ x)).vector, dp)
    c = first_moment / (mass or np.nan)
    dc = (dfirst_moment - np.outer(c, dmass)) / (mass or np.nan)
    shift = np.cross(dc.T, h[:3]).T + np.cross(c, dh[:3].T).T
    return np.concatenate([dc, dh[:3], dh[3:] - shift])


def shaking_derivatives(motion: MotionTangent) -> tuple[Array, Array]:
    """Return shaking force and moment of `mbdae.mechanism.signals.momentum`, (2, 3), and derivatives, (2, 3, m).

    A body's wrench f = I A + V x* (I V) about the world's origin is transported with the body, by its displacement
    twists X in the directions:

        df = X x* f + I a + v x* (I V) + V x* (I v),   v = dV - X x V,   a = dA - X x A
    """
    total, derivatives = np.zeros(6), np.zeros((6, len(motion.d.t)))
    for j, Y in enumerate(motion.model.inertias):
        if not j:
            continue
        pose, X, V, A = motion.placements[j], motion.X[j], motion.V[j][:, None], motion.A[j][:, None]
        inertia = pose.act(Y).matrix()
        h = inertia.dot(V)
        wrench = inertia.dot(A) + wrench_cross(V, h)
        v, a = motion.dV[j] - motion_cross(X, V), motion.dA[j] - motion_cross(X, A)
        total += wrench[:, 0]
        derivatives += wrench_cross(X, wrench) + inertia.dot(a) + wrench_cross(v, h) + wrench_cross(V, inertia.dot(v))
        local = pose.actInv(pin.Motion(motion.V[j])), pose.actInv(pin.Motion(motion.A[j]))
        for p, dp in zip(motion.parameters.all, motion.d.p, strict=True):
            if j in p.inertias:
                derivatives += np.outer(pose.act(pin.Force(pin.bodyRegressor(*local) @ p.inertias[j])).vector, dp)
    return -total.reshape(2, 3), -derivatives.reshape(2, 3, -1)
