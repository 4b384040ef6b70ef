"""Derivatives of positions, velocities and accelerations of frames."""

from collections.abc import Sequence

import numpy as np

from ...system import Array
from ..tree.frames import cross, point_velocities
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
        dp, speed = point_velocities(X, p), V[:3] + cross(V[3:], p)
        dspeed = point_velocities(dV, p) + cross(V[3:, None], dp)
        values[:, i] = p, speed, A[:3] + cross(A[3:], p) + cross(V[3:], speed)
        velocity_terms = cross(A[3:, None], dp) + cross(dV[3:], speed[:, None]) + cross(V[3:, None], dspeed)
        derivatives[:, i] = dp, dspeed, point_velocities(dA, p) + velocity_terms
    return values, derivatives
