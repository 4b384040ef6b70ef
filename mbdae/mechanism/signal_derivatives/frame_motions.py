"""Derivatives of positions, velocities and accelerations of frames."""

from collections.abc import Sequence

import numpy as np

from ...system import Array
from ..tree.frames import point_velocities
from .motion_tangent import MotionTangent


def frame_motion_derivatives(motion: MotionTangent, names: Sequence[str]) -> tuple[Array, Array]:
    """Return p, p' and p'' of the origins of n frames in the world, (3, n, 3), and their derivatives, (3, n, 3, m).

    Raises:
        UnknownNameError: for an unknown frame.
    """
    values, derivatives = np.empty((3, len(names), 3)), np.empty((3, len(names), 3, len(motion.d.t)))
    for i, name in enumerate(names):
        j, pose, X = motion.frame(name)
        p, (V, A, dV, dA) = pose.translation, (x[j] for x in (motion.V, motion.A, motion.dV, motion.dA))
        dp, speed = point_velocities(X, p), V[:3] + np.cross(V[3:], p)
        dspeed = point_velocities(dV, p) + np.cross(V[3:], dp.T).T
        values[:, i] = p, speed, A[:3] + np.cross(A[3:], p) + np.cross(V[3:], speed)
        moved = np.cross(A[3:], dp.T) + np.cross(dV[3:].T, speed) + np.cross(V[3:], dspeed.T)
        derivatives[:, i] = dp, dspeed, point_velocities(dA, p) + moved.T
    return values, derivatives
