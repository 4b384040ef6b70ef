"""Partial derivatives of frame origins with respect to configuration and parameters."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.frames import find_frame, point_velocities, support
from .parameter_partials import Parameters


def frame_partials(parameters: Parameters, q: Array, names: Sequence[str]) -> tuple[Array, Array]:
    """Return partials of the origins of m frames in the world with respect to q, in the tangent, and k parameters.

    Parameters change placements of joints and frames by twists xi in local axes; with the twist (v, w) = T xi in the
    world, an attached point p moves by v + w x p.

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
        placement = data.oMi[joint] * frame.placement
        by_q[m] = point_velocities(J * support(model, joint), placement.translation)
        for k, p in enumerate(parameters.all):
            motion = np.zeros(6)
            if i in p.frames:
                motion += placement.act(pin.Motion(p.frames[i])).vector
            ancestor = joint
            while ancestor:
                if ancestor in p.placements:
                    before = data.oMi[model.parents[ancestor]] * model.jointPlacements[ancestor]
                    motion += before.act(pin.Motion(p.placements[ancestor])).vector
                ancestor = model.parents[ancestor]
            by_p[m, :, k] = point_velocities(motion[:, None], placement.translation)[:, 0]
    return by_q, by_p
