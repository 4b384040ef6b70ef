"""Tangent of the motion of bodies, and of frames fixed to them, at a point in m directions.

A direction changes (q, v, v'), the mechanism's parameters and time. It displaces body i, and frames fixed to it, by the
twist X_i about the world's origin. With the columns J_i of its joint, w_i = J_i v_i, the parent body p, and the effect
P_i dp of parameters on the joint placement,

    X_i = X_p + P_i dp + J_i dq_i
    V_i = V_p + w_i                    dV_i = dV_p + d_i,   d_i = X_i x w_i + J_i dv_i
    A_i = A_p + J_i v'_i + V_i x w_i   dA_i = dA_p + X_i x (J_i v'_i) + J_i dv'_i + dV_i x w_i + V_i x d_i

on the expanded tree (`mbdae.mechanism.tree.expanded_tree`), where a joint's axes are fixed in its frame.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.expanded_tree import factor_joints
from ..tree.frames import Anchor, Pair, find_frame, motion_cross
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import update_motions, update_poses

if TYPE_CHECKING:
    from ..discrete_sensitivity.parameter_partials import Parameters
    from ..forces.force import ForceElement


class TangentDirections(NamedTuple):
    """Tangents of the arguments of signals, in m directions.

    Attributes:
        q, v: changes of q, in the tangent, and of v, (nv, m) each.
        s: changes of the states of forces, (ns, m).
        vdot: changes of v', (nv, m).
        lam: changes of the multipliers of all rows, (ng, m).
        p: changes of the parameters, (k, m).
        t: changes of time, (m,).
    """

    q: Array
    v: Array
    s: Array
    vdot: Array
    lam: Array
    p: Array
    t: Array


class MotionTangent:
    """The bodies of a mechanism at points of a motion, and their tangents.

    Args:
        parameters: varied parameters, with a workspace.

    Attributes:
        X, V, A, dV, dA: twists in the world by joint: displacements X (6, m), velocities V (6,), accelerations A (6,),
            and the derivatives dV and dA (6, m).
    """

    def __init__(self, parameters: "Parameters") -> None:
        self.parameters, self.system = parameters, parameters.system
        self.mechanism, self.model = self.system.mechanism, self.system.model
        self.expanded = self.system.inertial.model
        self.data = make_data(self.expanded)
        counts = [len(factor_joints(joint)) for joint in list(self.model.joints)[1:]]
        self.last_joints = [0, *np.cumsum(counts, dtype=int).tolist()]  # last joint of each joint in the expanded tree

    def evaluate(self, t: float, q: Array, v: Array, s: Array, vdot: Array, lam: Array, d: TangentDirections) -> None:
        """Evaluate at a point with directions d; then `system` is at this point, with accelerations for v' = 0."""
        self.t, self.q, self.v, self.s, self.vdot, self.lam, self.d = t, q, v, s, vdot, lam, d
        model, data, n = self.expanded, self.data, self.expanded.njoints
        pin.forwardKinematics(model, data, q)
        J = pin.computeJointJacobians(model, data, q).reshape(6, -1)
        m = len(d.t)
        X, dV, dA = np.zeros((3, n, 6, m))
        V, A = np.zeros((2, n, 6))
        firsts = {end + 1: j for j, end in enumerate(self.last_joints[:-1], 1)}
        for i in range(1, n):
            p, at = model.parents[i], slice(model.idx_vs[i], model.idx_vs[i] + model.nvs[i])
            J_i = J[:, at]
            w, a = J_i.dot(v[at])[:, None], J_i.dot(vdot[at])[:, None]
            X[i] = X[p] + J_i.dot(d.q[at])
            if i in firsts:
                placement = data.oMi[p] * model.jointPlacements[i]
                X[i] += self.placement_motion(placement, [x.placements.get(firsts[i]) for x in self.parameters.all])
            V[i] = V[p] + w[:, 0]
            d_i = motion_cross(X[i], w) + J_i.dot(d.v[at])
            dV[i] = dV[p] + d_i
            A[i] = A[p] + a[:, 0] + motion_cross(V[i][:, None], w)[:, 0]
            dA[i] = dA[p] + motion_cross(X[i], a) + J_i.dot(d.vdot[at])
            dA[i] += motion_cross(dV[i], w) + motion_cross(V[i][:, None], d_i)
        self.X, self.V, self.A, self.dV, self.dA = (x[self.last_joints] for x in (X, V, A, dV, dA))
        self.placements = [data.oMi[i] for i in self.last_joints]
        update_motions(self.model, self.system.workspace, q, v, np.zeros(len(v)))
        update_poses(self.model, self.system.workspace, q)

    def placement_motion(self, placement: pin.SE3, motions: list[Array | None]) -> Array:
        """Return motions (6, m) in the world caused by parameters, from motions (6,) in the axes of a placement."""
        out = np.zeros((6, len(self.d.t)))
        for motion, dp in zip(motions, self.d.p, strict=True):
            if motion is not None:
                out += np.outer(placement.act(pin.Motion(motion)).vector, dp)
        return out

    def frame(self, name: str) -> tuple[int, pin.SE3, Array]:
        """Return the parent joint of a frame, its placement in the world, and the motions (6, m) that displace it."""
        found = find_frame(self.model, name)
        i, joint = self.model.getFrameId(found.name, found.type), found.parentJoint
        placement = self.placements[joint] * found.placement
        return (
            joint,
            placement,
            self.X[joint] + self.placement_motion(placement, [x.frames.get(i) for x in self.parameters.all]),
        )

    def pair(self, pair: Pair) -> tuple[Array, Array]:
        """Return the motions (6, m) that displace both frames of a pair."""
        return self._frame_motion(pair.a), self._frame_motion(pair.b)

    def _frame_motion(self, a: Anchor) -> Array:
        return self.frame(a.name)[2]

    def relative(self, pair: Pair) -> tuple[Array, Array]:
        """Return the velocity V_b - V_a of a pair, (6,), and its derivatives (6, m)."""
        a, b = pair.a.joint, pair.b.joint
        return self.V[b] - self.V[a], self.dV[b] - self.dV[a]

    def perturbed_laws(self, law: int) -> "list[tuple[int, dict[int, ForceElement]]]":
        """Return the indices of the parameters that change a force, and the force with their perturbed values."""
        out = []
        for i, (p, laws) in enumerate(zip(self.parameters.all, self.parameters.laws, strict=True)):
            if law in p.forces:
                at = p.forces.index(law)
                out.append((i, {k: perturbed.bound[at][0] for k, perturbed in laws.perturbed.items()}))
        return out
