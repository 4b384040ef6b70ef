"""Pinocchio workspace without memory of order nv^3.

`pin.Model.createData` allocates second derivatives, four tensors of nv^3 numbers, and a dozen matrices of nv^2: 4 MB at
nv = 50, 0.3 GB at nv = 200, 30 GB at nv = 1000.
"""

from functools import cached_property

import numpy as np
import pinocchio as pin

MAX_COMPLETE_NV = 50
"""Largest nv of a workspace with memory for all algorithms of Pinocchio: 4 MB, created in 4 ms."""


def make_data(model: pin.Model, *, complete: bool = False) -> pin.Data:
    """Create a workspace for the algorithms that mbdae calls.

    Above `MAX_COMPLETE_NV` degrees of freedom it has memory for rnea, nonLinearEffects, forwardKinematics,
    computeJointJacobians and computePotentialEnergy only; `tree_terms.update_inertia` adds memory for crba in the world
    convention on first use. Any other algorithm writes out of bounds, since Pinocchio does not check sizes. It is
    therefore private: users work with ``mech.system().data``.

    Args:
        model: the joint tree.
        complete: allocate memory for all algorithms of Pinocchio at any size, 32 nv^3 bytes and more.
    """
    data = model.createData() if complete or model.nv <= MAX_COMPLETE_NV else _minimal_data(model)
    if bodies := getattr(model, "flexible", ()):
        data.flexible = [body.bind(model, data) for body in bodies]
    return data


def _minimal_data(model: pin.Model) -> pin.Data:
    data, n, nv = pin.Data(), model.njoints, model.nv
    data.joints.extend([joint.createData() for joint in model.joints])
    for placements in (data.oMi, data.liMi):
        placements.extend([pin.SE3.Identity()] * n)
    for motions in (data.v, data.a, data.a_gf):
        motions.extend([pin.Motion.Zero()] * n)
    for forces in (data.f, data.h):
        forces.extend([pin.Force.Zero()] * n)
    data.oYcrb.extend([pin.Inertia.Zero()] * n)
    data.mass.extend([0.0] * n)
    data.com.extend([np.zeros(3)] * n)
    data.nvSubtree.extend(_subtrees(model))
    data.J, data.Ag = np.zeros((6, nv)), np.zeros((6, nv))
    data.nle, data.tau = np.zeros(nv), np.zeros(nv)
    return data


class PinocchioData:
    """A `pin.Data` for users, separate from the workspace of a system."""

    model: pin.Model

    @cached_property
    def data(self) -> pin.Data:
        """Pinocchio data with memory for all algorithms, created on first use, without results.

        The system computes in a separate workspace, so that neither overwrites results of the other.
        """
        return self.model.createData()


def _subtrees(model: pin.Model) -> list[int]:
    """Return the degrees of freedom of each joint's subtree."""
    sizes, parents = model.nvs.tolist(), model.parents.tolist()
    for i in range(model.njoints - 1, 0, -1):
        sizes[parents[i]] += sizes[i]
    return sizes
