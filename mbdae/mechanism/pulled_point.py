"""A point of a body that a spring pulls towards a target."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..system import Array
from ..tolerances import TINY
from .mechanism import Mechanism
from .pinocchio_data import make_data


class Pull(NamedTuple):
    """A spring between a point and its target.

    Attributes:
        force: on the body in N, (3,), in the axes of the world.
        torque: of the force about the origin of the body's joint in N m, (3,).
        point: the point in the world in m, (3,).
    """

    force: Array
    torque: Array
    point: Array


class PulledPoint:
    """A point fixed to the body of a joint, and a critically damped spring to a target.

        f = m (w^2 (target - p) - 2 w p'),   1/m the largest eigenvalue of J_p M^-1 J_p^T

    The mass is the least that any direction of the tree without closures shows at the point, so that the spring has
    at most the frequency w.

    Args:
        mechanism: the mechanism.
        joint: index of the joint.
        point: in the world in m, (3,).
        q: configuration (nq,) at which the body is there.
    """

    def __init__(self, mechanism: Mechanism, joint: int, point: Array, q: Array) -> None:
        self.model, self.joint = mechanism.model, joint
        self.data = make_data(self.model)
        pin.forwardKinematics(self.model, self.data, q)
        self.local = self.data.oMi[joint].actInv(np.asarray(point, float))

    def pull(self, q: Array, v: Array, target: Array, frequency: float) -> Pull:
        """Return the force at a state (nq,), (nv,) towards a target (3,), with a frequency w in rad/s."""
        pin.computeJointJacobians(self.model, self.data, q)
        place = self.data.oMi[self.joint]
        point = place.act(self.local)
        J = pin.getJointJacobian(self.model, self.data, self.joint, pin.LOCAL_WORLD_ALIGNED)
        Jp = J[:3] - pin.skew(point - place.translation) @ J[3:]
        M = pin.crba(self.model, self.data, q)
        M = np.triu(M) + np.triu(M, 1).T
        mass = 1 / max(np.linalg.eigvalsh(Jp @ np.linalg.solve(M, Jp.T))[-1], TINY)
        force = mass * (frequency**2 * (target - point) - 2 * frequency * (Jp @ v))
        return Pull(force, np.cross(point - place.translation, force), point)


def joint_inertias(mechanism: Mechanism, q: Array) -> Array:
    """Return 1 / (M^-1)_ii at q (nq,), (nv,): the inertia that each coordinate shows while the others are free."""
    M = pin.crba(mechanism.model, make_data(mechanism.model), q)
    M = np.triu(M) + np.triu(M, 1).T
    return 1 / np.linalg.inv(M).diagonal()
