"""A compiled MuJoCo model, and the Pinocchio model of its tree."""

from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin

from .states import pose


class MjcfModel:
    """A compiled MuJoCo model with names for all objects, and the Pinocchio model built from it.

    Attributes:
        lib: the mujoco package.
        m: the mujoco.MjModel.
        model: the Pinocchio model.
        carriers: joint that carries each MuJoCo body, and the placement of the body in it.
        joint_parents: parent joint of each MuJoCo joint, and its placement in it.
        joints: name of each MuJoCo joint in Pinocchio.
        sites: name of the frame of each MuJoCo site.
    """

    def __init__(self, lib: ModuleType, m: Any, name: str) -> None:
        self.lib, self.m = lib, m
        self.model = pin.Model()
        self.model.name = name
        self.carriers: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
        self.joint_parents: list[tuple[int, pin.SE3]] = []
        self._taken = {"world", "universe"}
        self.joints = [self._name("JOINT", j, "joint") for j in range(m.njnt)]
        self._taken = {"world", "universe"}  # joints and frames may share names
        bodies = [self._name("BODY", b, "body") for b in range(1, m.nbody)]
        for b, body in enumerate(bodies, 1):
            self._add_body(b, body)
        self.sites = [self._name("SITE", s, "site") for s in range(m.nsite)]
        for s, site in enumerate(self.sites):
            self.add_frame(site, m.site_bodyid[s], m.site_pos[s], m.site_quat[s])

    def name(self, kind: str, i: int) -> str:
        """Return the name from the file, or an empty one."""
        return self.lib.mj_id2name(self.m, getattr(self.lib.mjtObj, f"mjOBJ_{kind}"), i) or ""

    def disables(self, flag: str) -> bool:
        """Return whether an option of the file disables a term of the dynamics."""
        bits = self.lib.mjtDisableBit
        bit = getattr(bits, f"mjDSBL_{flag}", None) or bits.mjDSBL_PASSIVE
        return bool(self.m.opt.disableflags & bit)

    def is_scalar(self, j: int) -> bool:
        """Return whether a MuJoCo joint is a hinge or a slide."""
        kinds = self.lib.mjtJoint
        return kinds(self.m.jnt_type[j]) in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)

    def unique(self, name: str) -> str:
        """Return a frame name that is not used yet."""
        new, k = name, 2
        while new in self._taken:
            new, k = f"{name}_{k}", k + 1
        self._taken.add(new)
        return new

    def _name(self, kind: str, i: int, word: str) -> str:
        return self.unique(self.name(kind, i) or f"{word}{i}")

    def add_frame(self, name: str, body: int, position: np.ndarray, quaternion: np.ndarray | None = None) -> str:
        """Add a frame on a MuJoCo body; return its name."""
        joint, placement = self.carriers[body]
        here = placement * pose(position, quaternion)
        self.model.addFrame(pin.Frame(name, joint, here, pin.FrameType.OP_FRAME))
        return name

    def _add_body(self, b: int, name: str) -> None:
        m, (joint, placement) = self.m, self.carriers[self.m.body_parentid[b]]
        placement = placement * pose(m.body_pos[b], m.body_quat[b])
        for j in range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b]):
            joint, placement = self._add_joint(j, joint, placement)
        self.carriers.append((joint, placement))
        rotation = pose(np.zeros(3), m.body_iquat[b]).rotation
        inertia = pin.Inertia(m.body_mass[b], m.body_ipos[b], rotation @ np.diag(m.body_inertia[b]) @ rotation.T)
        self.model.appendBodyToJoint(joint, inertia, placement)
        self.model.addFrame(pin.Frame(name, joint, placement, pin.FrameType.BODY))

    def _add_joint(self, j: int, parent: int, placement: pin.SE3) -> tuple[int, pin.SE3]:
        """Add a joint; return its number and the placement of the body in it, given that in the parent joint."""
        m, kinds = self.m, self.lib.mjtJoint
        at, axis = pose(m.jnt_pos[j]), np.array(m.jnt_axis[j])
        ref, after = float(m.qpos0[m.jnt_qposadr[j]]), at.inverse()
        match kinds(m.jnt_type[j]):
            case kinds.mjJNT_FREE:
                placement, joint, after = pin.SE3.Identity(), pin.JointModelFreeFlyer(), pin.SE3.Identity()
            case kinds.mjJNT_BALL:
                placement, joint = placement * at, pin.JointModelSpherical()
            case kinds.mjJNT_HINGE:
                placement = placement * at * pin.SE3(pin.exp3(-ref * axis), np.zeros(3))
                joint = pin.JointModelRevoluteUnaligned(axis)
            case kinds.mjJNT_SLIDE:
                placement = placement * at * pose(-ref * axis)
                joint = pin.JointModelPrismaticUnaligned(axis)
        self.joint_parents.append((parent, placement))
        number = self.model.addJoint(parent, joint, placement, self.joints[j])
        new = self.model.joints[number]
        pin_rows, mujoco_rows = slice(new.idx_v, new.idx_v + new.nv), slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + new.nv)
        self.model.armature[pin_rows] = m.dof_armature[mujoco_rows]
        if new.nv == 6:  # as a weightless mass at the origin: armature of Pinocchio would rotate with the body
            self.model.armature[pin_rows.start : pin_rows.start + 3] = 0
            origin = pin.Inertia(m.dof_armature[mujoco_rows.start], np.zeros(3), np.zeros((3, 3)))
            self.model.appendBodyToJoint(number, origin, pin.SE3.Identity())
        if m.jnt_limited[j] and new.nq == 1:
            (self.model.lowerPositionLimit[new.idx_q], self.model.upperPositionLimit[new.idx_q]) = m.jnt_range[j]
        self.model.upperDryFrictionLimit[pin_rows] = m.dof_frictionloss[mujoco_rows]
        self.model.lowerDryFrictionLimit[pin_rows] = -m.dof_frictionloss[mujoco_rows]
        if not self.disables("DAMPER"):
            self.model.damping[pin_rows] = m.dof_damping[mujoco_rows]
        return number, after
