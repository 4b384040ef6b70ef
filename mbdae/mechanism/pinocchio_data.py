"""Pinocchio workspace without memory of order nv^3.

`pin.Model.createData` allocates second derivatives, four tensors of nv^3 numbers, and a dozen matrices of nv^2: 4 MB at
nv = 50, 0.3 GB at nv = 200, 30 GB at nv = 1000.
"""

from functools import cached_property

import numpy as np
import pinocchio as pin

LARGEST = 50
"""Degrees of freedom up to which a workspace is Pinocchio's Data, with room for all its algorithms: 4 MB, 4 ms then."""


def make_data(model: pin.Model, *, complete: bool = False) -> pin.Data:
    """Make a workspace for the algorithms that mbdae calls.

    Above `LARGEST` degrees of freedom it serves crba in the world's convention, rnea, nonLinearEffects,
    forwardKinematics, computeJointJacobians and computePotentialEnergy alone. Any other algorithm writes outside of it,
    since Pinocchio does not check sizes. So it is private: users take ``mech.system().data``.

    Args:
        model: the joint tree.
        complete: of any size with room for all algorithms of Pinocchio, 32 nv^3 bytes and more.
    """
    if complete or model.nv <= LARGEST:
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


class PinocchioData:
    """A `pin.Data` for users, beside the workspace of a system."""

    model: pin.Model

    @cached_property
    def data(self) -> pin.Data:
        """Room for all algorithms of Pinocchio, made when first used; nothing is computed in it before.

        The system computes in another workspace, so that neither changes the other's results.
        """
        return self.model.createData()


def _subtrees(model: pin.Model) -> list[int]:
    """Return the degrees of freedom of each joint's subtree."""
    sizes, parents = model.nvs.tolist(), model.parents.tolist()
    for i in range(model.njoints - 1, 0, -1):
        sizes[parents[i]] += sizes[i]
    return sizes
