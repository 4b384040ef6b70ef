"""Symmetries of a mechanism: motions that leave its equations invariant, by which a periodic motion may advance.

A group element g(sigma) moves all bodies rigidly, oM_i -> exp(sigma xi) oM_i, or adds sigma to a cyclic joint. Its
tangent D acts on dq and v; w = d(q)/d(sigma). The vertical is the direction of gravity, or z without gravity. On
inclined ground, bodies may move along the line of steepest descent or across it, xi = (d, 0), with A w = (d, 0) for all
bodies and G w = 0 for position-level rows G.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import InputError, UnknownNameError
from ...system import Array
from ...tolerances import CLOSED, EPS, SUM_ROUNDING, VISIBLE
from ..formulations.index2 import Index2System
from ..hybrid.mode_point import AllRows
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import require_rigid

if TYPE_CHECKING:
    from ..mechanism import Mechanism

AXES = {"x": 0, "y": 1, "z": 2}  # axes of translations in the world
MOTIONS = (*AXES, "incline", "level", "turn")  # translations; down and across an incline; rotation about the vertical
ITERATIONS = 20


def cyclic_joints(mech: "Mechanism") -> dict[str, str]:
    """Return the joints of one coordinate by name of their symmetry: ``"x (joint)"`` if a motion has the same name."""
    names = [n for n in mech.joint_names if mech.model.joints[mech.model.getJointId(n)].nv == 1]
    return {f"{n} (joint)" if n in MOTIONS else n: n for n in names}


@dataclass(frozen=True)
class Symmetry:
    """One continuous symmetry.

    Attributes:
        name: ``"x"``, ``"y"``, ``"z"``, ``"incline"``, ``"level"``, ``"turn"``, or one of `cyclic_joints`.
        system: a workspace.
    """

    name: str
    system: Index2System

    @classmethod
    def named(cls, system: Index2System, names: Sequence[str]) -> "tuple[Symmetry, ...]":
        """Return symmetries by name.

        Raises:
            UnknownNameError: lists the valid names.
        """
        mech = system.mechanism
        known = (*MOTIONS, *cyclic_joints(mech))
        for name in names:
            if name not in known:
                raise UnknownNameError("symmetry", name, known)
        if not set(names).isdisjoint(MOTIONS):
            require_rigid(mech.model, "symmetries")
        if len(set(names)) < len(names):
            raise InputError(f"each symmetry may be named only once, got {', '.join(names)}")
        return tuple(cls(name, system) for name in names)

    @property
    def moves_bodies(self) -> bool:
        """Whether it is a rigid motion of all bodies, not a shift of a joint."""
        return self.name in MOTIONS

    def twist(self, q: Array) -> Array:
        """Return xi (6,) of a motion of all bodies, in world axes at the origin.

        Raises:
            InputError: if the rows do not allow translations along an incline.
        """
        if self.name in AXES:
            return np.eye(6)[AXES[self.name]]
        gravity = self.system.model.gravity.linear
        up = -gravity / np.linalg.norm(gravity) if gravity.any() else np.eye(3)[2]
        if self.name == "turn":
            return np.concatenate([np.zeros(3), up])
        free = self._free_translations(q)
        down = -free @ (free.T @ up)
        size = np.linalg.norm(down)
        if not size > VISIBLE:
            raise InputError(f"symmetry {self.name!r}: {self.system.mechanism.title} is not on an incline")
        down = down / size
        if self.name == "incline":
            return np.concatenate([down, np.zeros(3)])
        across = np.cross(up, down)
        size = np.linalg.norm(across)
        if not size > VISIBLE:
            raise InputError(f"symmetry {self.name!r}: the incline of {self.system.mechanism.title} is vertical")
        return np.concatenate([across / size, np.zeros(3)])

    def _free_translations(self, q: Array) -> Array:
        """Return an orthonormal basis (3, k) of the translations that joints and position-level rows allow."""
        s, A = self.system, self._jacobians(q).reshape(-1, self.system.nv)
        scales = s.mechanism.row_scales[s.constraints.positional]
        G = AllRows(s)(0.0, q)[1][s.constraints.positional] / scales[:, None]
        T = np.tile(np.eye(6)[:, :3], (len(self.bodies), 1))
        both = np.block([[A, -T], [G, np.zeros((len(G), 3))]])
        _, sizes, V = np.linalg.svd(both)
        rank = int(np.count_nonzero(sizes > VISIBLE * sizes[0]))
        U, sizes, _ = np.linalg.svd(V[rank:, -3:].T)
        return U[:, : np.count_nonzero(sizes > VISIBLE)]

    def direction(self, q: Array) -> Array:
        """Return w (nv,), the velocity of the symmetry motion.

        Raises:
            InputError: if the joints do not allow the motion.
        """
        if not self.moves_bodies:
            return np.eye(self.system.nv)[self._index]
        twist = self.twist(q)
        A, b = self._jacobians(q).reshape(-1, self.system.nv), np.tile(twist, len(self.bodies))
        w = np.linalg.lstsq(A, b, rcond=None)[0]
        if not np.abs(A @ w - b).max(initial=0.0) <= CLOSED * max(1.0, np.abs(w).max()):
            raise InputError(f"symmetry {self.name!r}: the joints of {self.system.mechanism.title} do not allow it")
        return w

    def moved(self, q: Array, sigma: float) -> Array:
        """Return g(sigma) q, (nq,)."""
        s = self.system.manifold
        w = sigma * self.direction(q)
        if not self.moves_bodies:
            return s.integrate(q, w)
        motion = pin.exp6(self.twist(q) * sigma)
        targets = [motion * placement for placement in self._placements(q)]
        target = s.integrate(q, w)
        for _ in range(ITERATIONS):
            placements = self._placements(target)
            errors = [pin.log6(t * p.inverse()).vector for t, p in zip(targets, placements, strict=True)]
            size = np.abs(errors).max(initial=0.0)
            if size <= SUM_ROUNDING:
                break
            A = self._jacobians(target).reshape(-1, self.system.nv)
            target = s.integrate(target, np.linalg.lstsq(A, np.concatenate(errors), rcond=EPS)[0])
        return target

    def tangent(self, q: Array, moved: Array, sigma: float) -> Array:
        """Return D (nv, nv), which maps dq and v at q to dq and v at g(sigma) q."""
        if not self.moves_bodies:
            return np.eye(self.system.nv)
        action = pin.exp6(self.twist(q) * sigma).action
        before, after = (self._jacobians(x).reshape(-1, self.system.nv) for x in (q, moved))
        rotated = np.vstack([action @ J for J in before.reshape(-1, 6, self.system.nv)])
        return np.linalg.lstsq(after, rotated, rcond=None)[0]

    def velocity_change(self, q: Array, v: Array) -> Array:
        """Return d(D v)/d(sigma) at sigma = 0, (nv,); nonzero for components of v not in body axes."""
        if not self.moves_bodies:
            return np.zeros(self.system.nv)
        twist = pin.Motion(self.twist(q))
        J = self._jacobians(q)
        rates = self._jacobian_rates(q)
        right = np.concatenate([twist.cross(pin.Motion(A @ v)).vector for A in J]) - (rates @ v).ravel()
        return np.linalg.lstsq(J.reshape(-1, self.system.nv), right, rcond=None)[0]

    def _jacobian_rates(self, q: Array) -> Array:
        """Return the rates of `_jacobians` along the symmetry motion, (n, 6, nv)."""
        model, data, world = self.system.model, make_data(self.system.model, complete=True), pin.ReferenceFrame.WORLD
        pin.computeJointJacobiansTimeVariation(model, data, q, self.direction(q))
        return self._stacked([pin.getJointJacobianTimeVariation(model, data, i, world) for i in self.bodies])

    @property
    def _index(self) -> int:
        model, joint = self.system.model, cyclic_joints(self.system.mechanism)[self.name]
        return int(model.joints[model.getJointId(joint)].idx_v)

    @property
    def bodies(self) -> list[int]:
        """Joints of bodies with mass, and leaves of the tree; massless intermediate bodies need not move rigidly."""
        model = self.system.mechanism.model
        ends = set(range(1, model.njoints)) - set(model.parents)
        return [i for i in range(1, model.njoints) if i in ends or model.inertias[i].mass > 0]

    def _placements(self, q: Array) -> list[pin.SE3]:
        s = self.system
        pin.forwardKinematics(s.model, s.workspace, q)
        return [pin.SE3(s.workspace.oMi[i]) for i in self.bodies]

    def _jacobians(self, q: Array) -> Array:
        """Return the Jacobians of the bodies in world axes at the origin, (n, 6, nv)."""
        s = self.system
        pin.computeJointJacobians(s.model, s.workspace, q)
        world = pin.ReferenceFrame.WORLD
        return self._stacked([pin.getJointJacobian(s.model, s.workspace, i, world) for i in self.bodies])

    def _stacked(self, jacobians: list[Array]) -> Array:
        """Stack Jacobians to (n, 6, nv): Pinocchio returns (6,) where nv is 1."""
        return np.reshape(jacobians, (-1, 6, self.system.nv))
