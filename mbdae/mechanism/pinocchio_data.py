"""A Pinocchio workspace that does not grow with nv^3.

`pin.Model.createData` sets aside room for second derivatives, four tensors of nv^3 numbers, and for a dozen matrices
of nv^2: 4 MB at nv = 50, 0.3 GB at nv = 200, 30 GB at nv = 1000.
"""

import numpy as np
import pinocchio as pin

LARGEST = 50
"""Degrees of freedom up to which a workspace is Pinocchio's own, with room for all its algorithms: 4 MB, 4 ms then."""


def make_data(model: pin.Model) -> pin.Data:
    """Make a workspace, which force laws and users of ``mech.system().data`` see, too.

    Up to `LARGEST` degrees of freedom it serves all algorithms of Pinocchio. Above, it serves crba in the world's
    convention, rnea, nonLinearEffects, forwardKinematics, computeJointJacobians and computePotentialEnergy; others
    would write beside it (Pinocchio does not check) and take ``model.createData()``.
    """
    if model.nv <= LARGEST:
        return model.createData()
    data, n, nv = pin.Data(), model.njoints, model.nv
    data.joints.extend([joint.createData() for joint in model.joints])
    for places in (data.oMi, data.liMi):
        places.extend([pin.SE3.Identity()] * n)
    for motions in (data.v, data.a, data.a_gf):
        motions.extend([pin.Motion.Zero()] * n)
    for forces in (data.f, data.h):
        forces.extend([pin.Force.Zero()] * n)
    data.oYcrb.extend([pin.Inertia.Zero()] * n)
    data.mass.extend([0.0] * n)
    data.com.extend([np.zeros(3)] * n)
    data.nvSubtree.extend(_subtrees(model))
    data.J, data.Ag, data.M = np.zeros((6, nv)), np.zeros((6, nv)), np.zeros((nv, nv))
    data.nle, data.tau = np.zeros(nv), np.zeros(nv)
    return data


def _subtrees(model: pin.Model) -> list[int]:
    """Degrees of freedom from each joint on."""
    sizes, parents = model.nvs.tolist(), model.parents.tolist()
    for i in range(model.njoints - 1, 0, -1):
        sizes[parents[i]] += sizes[i]
    return sizes
