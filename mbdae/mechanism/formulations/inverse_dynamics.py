"""Inverse dynamics M v' + nle and its exact partial derivatives, on the expanded tree."""

from functools import cached_property

import numpy as np
import pinocchio as pin

from ...system import Array
from ..flexible.partials import inertial_partials
from ..tree.expanded_tree import expand
from ..tree.frames import motion_cross, wrench_matrix
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import copy_model, flexible_bodies, symmetric, update_inertia

MAX_PINOCCHIO_NV = 100
"""Largest nv for Pinocchio's derivatives, whose workspace has several nv^3 numbers, up to 40 MB."""


class InverseDynamicsPartials:
    """Inverse dynamics M v' + nle of a model, in a separate workspace that is created on first use."""

    def __init__(self, model: pin.Model) -> None:
        self.compact = model

    @cached_property
    def model(self) -> pin.Model:
        """The expanded tree."""
        return expand(self.compact)

    @cached_property
    def data(self) -> pin.Data:
        """Workspace of the expanded tree."""
        return self.model.createData() if self.model.nv <= MAX_PINOCCHIO_NV else make_data(self.model)

    def partials(self, q: Array, v: Array, vdot: Array) -> tuple[Array, Array, Array]:
        """Return M and the derivatives of M v' + nle with respect to q and v, (nv, nv) each; views of the workspace."""
        if self.model.nv > MAX_PINOCCHIO_NV:
            M, dtau_dq, dtau_dv = self._composite_body_partials(q, v, vdot)
        else:
            pin.computeRNEADerivatives(self.model, self.data, q, v, vdot)
            M, dtau_dq, dtau_dv = self.data.M, self.data.dtau_dq, self.data.dtau_dv
        if self._flexible is None:
            return M, dtau_dq, dtau_dv
        data, base = self._flexible, -self.compact.gravity.vector
        M = symmetric(update_inertia(self.compact, data, q))
        joint = np.repeat(np.arange(self.model.njoints), self.model.nvs)
        more = [inertial_partials(body, data, joint, q, v, vdot, base) for body in data.flexible]
        return M, dtau_dq + sum(x for x, _ in more), dtau_dv + sum(x for _, x in more)

    @cached_property
    def _flexible(self) -> pin.Data | None:
        """Workspace of the model with its flexible bodies; None if there are none."""
        return make_data(self.compact) if flexible_bodies(self.compact) else None

    @cached_property
    def without_gravity(self) -> "InverseDynamicsPartials":
        """Inverse dynamics of the model without gravity."""
        model = copy_model(self.compact)
        model.gravity = pin.Motion.Zero()
        return InverseDynamicsPartials(model)

    def momentum_partials(self, q: Array, w: Array) -> tuple[Array, Array]:
        """Return M and d(M w)/dq for constant w, (nv, nv) each; views of the workspace."""
        return self.without_gravity.partials(q, np.zeros_like(w), w)[:2]

    def _composite_body_partials(self, q: Array, v: Array, vdot: Array) -> tuple[Array, Array, Array]:
        """Return the values of `partials` with O(nv^2) memory, from composite bodies, by Pinocchio's formulas.

        Source: Carpentier, Mansard, Robotics: Science and Systems (2018).
        """
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q, v, vdot)
        J, gravity = pin.computeJointJacobians(model, data, q), model.gravity
        Y, B = np.zeros((2, model.njoints, 6, 6))  # composite inertias; their rates plus crossed momenta
        F, V, A = np.zeros((3, model.njoints, 6))
        A[0] = -gravity.vector
        for j in range(1, model.njoints):
            placement, inertia = data.oMi[j], data.oMi[j].act(model.inertias[j])
            velocity, acceleration = placement.act(data.v[j]), placement.act(data.a[j]) - gravity
            momentum = inertia * velocity
            Y[j], V[j], A[j] = inertia.matrix(), velocity.vector, acceleration.vector
            B[j] = inertia.variation(velocity) + wrench_matrix(momentum.vector)
            F[j] = (inertia * acceleration + velocity.cross(momentum)).vector
        for j in range(model.njoints - 1, 0, -1):
            for sums in (Y, B, F):
                sums[model.parents[j]] += sums[j]
        joint = np.repeat(np.arange(model.njoints), model.nvs)
        parent = np.array(model.parents)[joint]
        V_joint, V_parent = V[joint].T, V[parent].T
        dV = motion_cross(V_parent, J)
        dA = motion_cross(A[parent].T, J) + motion_cross(V_parent, dV)
        dA_v = motion_cross(V_joint, J) + dV

        def times(X: Array, columns: Array) -> Array:
            return np.matmul(X[joint], columns.T[:, :, None])[:, :, 0].T

        YJ, BTJ = times(Y, J), times(B.transpose(0, 2, 1), J)
        FJ = times(np.array([wrench_matrix(wrench) for wrench in F]), J)
        supports, proper = self.supports, self.supports & ~self.supports.T  # ancestors or self; proper ancestors
        dtau_dq = supports * J.T.dot(times(B, dV) + times(Y, dA)) + proper * J.T.dot(FJ)
        dtau_dq += (proper * (dA.T.dot(YJ) + dV.T.dot(BTJ))).T
        dtau_dv = supports * J.T.dot(times(B, J) + times(Y, dA_v)) + (proper * (dA_v.T.dot(YJ) + J.T.dot(BTJ))).T
        JYJ = J.T.dot(YJ)
        return supports * JYJ + (proper * JYJ).T + np.diag(model.armature), dtau_dq, dtau_dv

    @cached_property
    def supports(self) -> Array:
        """True where the joint of row m is the joint of column k or an ancestor of it, (nv, nv)."""
        joint = np.repeat(np.arange(self.model.njoints), self.model.nvs)
        out = np.zeros((self.model.njoints, self.model.njoints), bool)
        for j in range(1, self.model.njoints):
            out[list(self.model.supports[j]), j] = True
        return out[np.ix_(joint, joint)]
