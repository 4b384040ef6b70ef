"""A flexible body in a workspace: motions and Jacobians of its nodes, and its terms of M and nle.

At a node, d = r + Phi q + Phi2 q q / 2, theta = Psi q, E and Jr of `rotation_vector`, Phi denotes Phi + Phi2 q, and
with nu = (v, w, q') of the body in its axes:

    J_n = [ E^T   -E^T [d]x   E^T Phi ]      twist = J_n nu,   twist' = J_n nu' + beta,   in the axes of the node
          [ 0      E^T        Jr Psi  ]
    beta = ( (E^T u) x wr + E^T (w x Phi q' + Phi2 q' q'),   (E^T w) x wr + (dJr(theta) s) s )
    u = v + w x d + Phi q',   s = Psi q',   wr = Jr s
"""


import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.frames import cross
from .modal_body import ModalBody, Node
from .rotation_vector import rotation_vector


class BoundNode:
    """A node in a workspace.

    Attributes:
        index: its entry in ``data.oMi``.
        node: the node.
        columns: columns of J for the modes, about the world's origin, (6, k); updated in place.
        rotation: rotation of the node relative to the frame, at the current poses.
    """

    def __init__(self, index: int, node: Node) -> None:
        self.index, self.node, self.columns = index, node, np.zeros((6, node.Phi.shape[1]))
        self.rotation = rotation_vector(np.zeros(3))

    def split_columns(self, data: pin.Data) -> tuple[Array, Array]:
        """Return the columns as a sum of translations T along fixed axes and rotations W, (6, k) each."""
        W = self.columns.copy()
        W[:3] = pin.skew(data.oMi[self.index].translation) @ W[3:]
        return self.columns - W, W

    def translation_change(self, frame: pin.SE3, z: Array) -> Array:
        """Return the derivatives of the translations T z with respect to q_m, as motions (6, k); z (k,)."""
        out = np.zeros_like(self.columns)
        if self.node.Phi2 is not None:
            out[:3] = frame.rotation @ (self.node.Phi2 @ z)
        return out

    def rotation_change(self, data: pin.Data, z: Array) -> Array:
        """Return the derivatives of the rotation Jr z with respect to q_m in axes of the node, as motions (6, k)."""
        pose = data.oMi[self.index]
        change = pose.rotation @ self.rotation.jacobian_partials(z) @ self.node.Psi
        return np.concatenate([pin.skew(pose.translation) @ change, change])


class BoundBody:
    """A flexible body bound to a workspace.

    Attributes:
        joint, placement: the joint that carries the frame, and the placement of the frame in it.
        at: slice of the velocities of the modes.
        nodes: the nodes.
    """

    def __init__(
        self, model: pin.Model, data: pin.Data, base: tuple[int, pin.SE3], first: pin.JointModel, modal: ModalBody
    ) -> None:
        self.modal, k = modal, modal.modes
        self.joint, self.placement = base
        self.at, self.iq = slice(first.idx_v, first.idx_v + k), slice(first.idx_q, first.idx_q + k)
        joints = list(model.supports[self.joint])[1:]
        self.base = np.array([i for j in joints for i in range(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])], int)
        self.nodes: list[BoundNode] = []
        for node in modal.nodes.values():
            self.nodes.append(BoundNode(len(data.oMi), node))
            data.oMi.append(pin.SE3.Identity())
            data.v.append(pin.Motion.Zero())
            data.a.append(pin.Motion.Zero())

    def write(self, modal: ModalBody, placement: pin.SE3) -> None:
        """Replace the body by another with the same numbers of modes and nodes, and the placement of its frame."""
        self.modal, self.placement = modal, placement
        for n, node in zip(self.nodes, modal.nodes.values(), strict=True):
            n.node = node

    def pose(self, data: pin.Data) -> pin.SE3:
        """Return the pose of the frame in the world; the pose of the joint must be current."""
        return data.oMi[self.joint] * self.placement

    def update_poses(self, data: pin.Data, q: Array) -> None:
        """Update poses and columns of the nodes; the pose of the frame must be current."""
        x, pose = q[self.iq], self.pose(data)
        R, p = pose.rotation, pose.translation
        for n in self.nodes:
            rotation = n.rotation = rotation_vector(n.node.Psi @ x)
            d, Phi = n.node.displaced(x)
            at, E = R @ d + p, R @ rotation.E
            data.oMi[n.index] = pin.SE3(E, at)
            n.columns[3:] = E @ rotation.Jr @ n.node.Psi
            n.columns[:3] = R @ Phi + pin.skew(at) @ n.columns[3:]

    def update_motions(self, data: pin.Data, q: Array, v: Array, a: Array) -> None:
        """Update velocities and accelerations of the nodes, for v' = a; poses and motions of the frame are current."""
        x, u, du = q[self.iq], v[self.at], a[self.at]
        V, A = (self.placement.actInv(x[self.joint]) for x in (data.v, data.a))
        w = V.angular
        for n in self.nodes:
            node, rotation = n.node, n.rotation
            d, Phi = node.displaced(x)
            relative, s = Phi @ u, node.Psi @ u
            rate = Phi @ du if node.Phi2 is None else Phi @ du + node.Phi2 @ u @ u
            ET, wr = rotation.E.T, rotation.Jr @ s
            at, Ew = ET @ (V.linear + cross(w, d) + relative), ET @ w
            data.v[n.index] = pin.Motion(at, Ew + wr)
            linear = ET @ (A.linear + cross(A.angular, d) + rate + cross(w, relative)) + cross(at, wr)
            angular = ET @ A.angular + rotation.Jr @ (node.Psi @ du) + cross(Ew, wr) + rotation.jacobian_partials(s) @ s
            data.a[n.index] = pin.Motion(linear, angular)

    def add_inertia(self, data: pin.Data, q: Array, M: Array) -> None:
        """Add the terms of the modes to the upper triangle of M (nv, nv); J and the pose of the frame are current."""
        D, J, base = self.modal.delta(q[self.iq]), self._base_columns(data), self.base
        M[base[:, None], base] += J.T @ D[:6, :6] @ J
        M[base, self.at] += J.T @ D[:6, 6:]
        M[self.at, self.at] += D[6:, 6:]

    def add_bias(self, data: pin.Data, q: Array, v: Array, nle: Array) -> None:
        """Add the terms of the modes to nle (nv,); J, ``data.v`` and ``data.a_gf`` are current."""
        acceleration = self.placement.actInv(data.a_gf[self.joint])
        F = self._force(self.modal, data, q, v, acceleration, np.zeros(self.modal.modes))
        nle[self.base] += F[:6] @ self._base_columns(data)
        nle[self.at] += F[6:]

    def add_force(
        self, modal: ModalBody, data: pin.Data, q: Array, v: Array, a: Array, gravity: Array, out: Array
    ) -> None:
        """Add the terms of M v' + nle of a modal body to out (nv,); motions for v' = a are current."""
        F = self._force(modal, data, q, v, self._acceleration_without_gravity(data, gravity), a[self.at])
        out[self.base] += F[:6] @ self._base_columns(data)
        out[self.at] += F[6:]

    def add_weight(self, data: pin.Data, q: Array, gravity: Array, out: Array) -> None:
        """Add the weight terms of the modes to out (nv,), gravity in m/s^2; J and poses are current."""
        F = self.modal.delta(q[self.iq])[:, :3] @ (self.pose(data).rotation.T @ -gravity)
        out[self.base] += F[:6] @ self._base_columns(data)
        out[self.at] += F[6:]

    def _acceleration_without_gravity(self, data: pin.Data, gravity: Array) -> pin.Motion:
        """Return the acceleration of the frame minus gravity, in its axes."""
        weight = pin.Motion(data.oMi[self.joint].rotation.T @ gravity, np.zeros(3))
        return self.placement.actInv(data.a[self.joint] - weight)

    def _velocity(self, data: pin.Data, v: Array) -> Array:
        """Return the velocities of the frame, in its axes, and of the modes, (6 + k,)."""
        return np.concatenate([self.placement.actInv(data.v[self.joint]).vector, v[self.at]])

    def _force(
        self, modal: ModalBody, data: pin.Data, q: Array, v: Array, acceleration: pin.Motion, rates: Array
    ) -> Array:
        """Return the inertia force on frame and modes in the axes of the frame, without the rigid body, (6 + k,)."""
        x, A = q[self.iq], np.concatenate([acceleration.vector, rates])
        return modal.inertial_force(x, self._velocity(data, v), A)

    def inertia_wrench(self, data: pin.Data, q: Array, v: Array, a: Array, gravity: Array | None = None) -> Array:
        """Return the force and the moment about the origin, world axes, (6,), that the deformation adds to m a - m g.

        Motions in ``data`` are those of v and v' = a; gravity in m/s^2, none if omitted.
        """
        acceleration = self._acceleration_without_gravity(data, np.zeros(3) if gravity is None else gravity)
        force = self._force(self.modal, data, q, v, acceleration, a[self.at])
        return self.pose(data).act(pin.Force(force[:6])).vector

    def momentum(self, data: pin.Data, q: Array, v: Array) -> Array:
        """Return the momenta that the deformation adds, about the origin, world axes, (6,); motions are current."""
        return self.pose(data).act(pin.Force(self.modal.delta(q[self.iq])[:6] @ self._velocity(data, v))).vector

    def first_moment(self, data: pin.Data, q: Array) -> Array:
        """Return the change of mass times centre of mass by the deformation, world axes, (3,), in kg m."""
        return self.pose(data).rotation @ self.modal.first_moment(q[self.iq])

    def _base_columns(self, data: pin.Data) -> Array:
        """Return the columns of J that move the frame, in its axes, (6, n)."""
        return self.pose(data).actionInverse @ data.J.reshape(6, -1)[:, self.base]
