"""A point of a body that a spring pulls towards a target."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..system import Array
from ..tolerances import TINY
from .mechanism import Mechanism
from .tree.pinocchio_data import make_data
from .tree.tree_terms import require_rigid


class Pull(NamedTuple):
    """A spring between a point and its target.

    Attributes:
        tau: generalized force J_p^T f in N m and N, (nv,).
        point: the point in the world in m, (3,).
    """

    tau: Array
    point: Array


class PulledPoint:
    """A point fixed to the body of a joint, and a critically damped spring to a target.

        f = m (w^2 (target - p) - 2 w p'),   tau = J_p^T f,   1/m the largest eigenvalue of J_p M^-1 J_p^T

    m is the smallest effective mass at the point, over all directions, of the tree without closures, so that the
    frequency of the spring is at most w.

    Args:
        mechanism: the mechanism.
        joint: index of the joint.
        point: the point in the world in m, (3,).
        q: configuration (nq,) for which the point is given.
    """

    def __init__(self, mechanism: Mechanism, joint: int, point: Array, q: Array) -> None:
        self.mechanism, self.model, self.joint = mechanism, mechanism.model, joint
        require_rigid(self.model, "pulls on points")
        self.data = make_data(self.model)
        pin.forwardKinematics(self.model, self.data, q)
        self.local = self.data.oMi[joint].actInv(np.asarray(point, float))

    def pull(self, q: Array, v: Array, target: Array, frequency: float) -> Pull:
        """Return the force at a state (nq,), (nv,) towards a target (3,), with a frequency w in rad/s."""
        pin.computeJointJacobians(self.model, self.data, q)
        placement = self.data.oMi[self.joint]
        point = placement.act(self.local)
        J = pin.getJointJacobian(self.model, self.data, self.joint, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        Jp = J[:3] - pin.skew(point - placement.translation) @ J[3:]
        mass = 1 / max(np.linalg.eigvalsh(Jp @ np.linalg.solve(self.mechanism.mass_matrix(q), Jp.T))[-1], TINY)
        force = mass * (frequency**2 * (target - point) - 2 * frequency * (Jp @ v))
        return Pull(Jp.T @ force, point)


def joint_inertias(mechanism: Mechanism, q: Array) -> Array:
    """Return 1 / (M^-1)_ii at q (nq,), (nv,): the inertia of each coordinate while the others are free."""
    return 1 / np.linalg.inv(mechanism.mass_matrix(q)).diagonal()
