"""Derivatives of the centre of mass and the momenta."""

import numpy as np
import pinocchio as pin

from ...system import Array
from ..frames import motion_cross, point_velocities
from .motion_tangent import MotionTangent
from .wrenches import wrench_cross


def momentum_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives of the columns of `mbdae.mechanism.momentum.momentum`, (9, m)."""
    m, d = len(motion.d.t), motion.d
    mass, first, h = 0.0, np.zeros(3), np.zeros(6)  # sums of m, m c and momenta at the world's origin
    dmass, dfirst, dh = np.zeros(m), np.zeros((3, m)), np.zeros((6, m))
    for j, Y in enumerate(motion.model.inertias):
        if not j:
            continue
        pose, X, V, dV = motion.placements[j], motion.X[j], motion.V[j], motion.dV[j]
        inertia, c, V_local = pose.act(Y), pose.act(Y.lever), pose.actInv(pin.Motion(V))
        momentum = (inertia * pin.Motion(V)).vector
        mass, first, h = mass + Y.mass, first + Y.mass * c, h + momentum
        dfirst += Y.mass * point_velocities(X, c)
        dh += wrench_cross(X, momentum[:, None]) + inertia.matrix().dot(dV - motion_cross(X, V[:, None]))
        for p, dp in zip(motion.parameters.all, d.p, strict=True):
            if j in p.inertias:
                x = p.inertias[j]
                dmass += x[0] * dp
                dfirst += np.outer(x[0] * pose.translation + pose.rotation.dot(x[1:4]), dp)
                dh += np.outer(pose.act(pin.Force(pin.bodyRegressor(pin.Motion.Zero(), V_local) @ x)).vector, dp)
    c = first / (mass or np.nan)
    dc = (dfirst - np.outer(c, dmass)) / (mass or np.nan)
    moved = np.cross(dc.T, h[:3]).T + np.cross(c, dh[:3].T).T
    return np.concatenate([dc, dh[:3], dh[3:] - moved])
