"""Partial derivatives of frame origins by configuration and parameters."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from ...system import Array
from ..frames import find_frame, support
from .parameter_partials import Parameters


def frame_partials(parameters: Parameters, q: Array, names: Sequence[str]) -> tuple[Array, Array]:
    """Return the partials of the origins of m frames in the world by q, in the tangent, and by k parameters.

    Placements of joints and frames change by motions xi in their own axes: with the motion T xi in the world, an
    attached point p moves by its linear part plus its rotation x p.

    Returns:
        (m, 3, nv) and (m, 3, k).

    Raises:
        UnknownNameError: for an unknown frame.
    """
    model, data = parameters.system.model, parameters.system.workspace
    J = pin.computeJointJacobians(model, data, q).reshape(6, -1)
    by_q, by_p = np.zeros((len(names), 3, model.nv)), np.zeros((len(names), 3, len(parameters)))
    for m, name in enumerate(names):
        frame = find_frame(model, name)
        i, joint = model.getFrameId(frame.name, frame.type), frame.parentJoint
        place = data.oMi[joint] * frame.placement
        by_q[m] = _of_point(J * support(model, joint), place.translation)
        for k, p in enumerate(parameters.all):
            moved = np.zeros(6)
            if i in p.frames:
                moved += place.act(pin.Motion(p.frames[i])).vector
            above = joint
            while above:
                if above in p.places:
                    before = data.oMi[model.parents[above]] * model.jointPlacements[above]
                    moved += before.act(pin.Motion(p.places[above])).vector
                above = model.parents[above]
            by_p[m, :, k] = _of_point(moved[:, None], place.translation)[:, 0]
    return by_q, by_p


def _of_point(motions: Array, p: Array) -> Array:
    """Return the velocities (3, n) of a point under motions (6, n) at the world's origin."""
    return motions[:3] + np.cross(motions[3:].T, p).T
