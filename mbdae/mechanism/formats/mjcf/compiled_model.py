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
        home: for each MuJoCo body the joint that carries it and its placement there.
        before: for each MuJoCo joint the joint that carries it and its placement there.
        joints: Pinocchio's name of each MuJoCo joint.
        sites: name of the frame of each MuJoCo site.
    """

    def __init__(self, lib: ModuleType, m: Any, name: str) -> None:
        self.lib, self.m = lib, m
        self.model = pin.Model()
        self.model.name = name
        self.home: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
        self.before: list[tuple[int, pin.SE3]] = []
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
        """Return whether the file's option disables a term of the dynamics."""
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
        joint, place = self.home[body]
        here = place * pose(position, quaternion)
        self.model.addFrame(pin.Frame(name, joint, here, pin.FrameType.OP_FRAME))
        return name

    def _add_body(self, b: int, name: str) -> None:
        m, (joint, place) = self.m, self.home[self.m.body_parentid[b]]
        place = place * pose(m.body_pos[b], m.body_quat[b])
        for j in range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b]):
            joint, place = self._add_joint(j, joint, place)
        self.home.append((joint, place))
        turn = pose(np.zeros(3), m.body_iquat[b]).rotation
        inertia = pin.Inertia(m.body_mass[b], m.body_ipos[b], turn @ np.diag(m.body_inertia[b]) @ turn.T)
        self.model.appendBodyToJoint(joint, inertia, place)
        self.model.addFrame(pin.Frame(name, joint, place, pin.FrameType.BODY))

    def _add_joint(self, j: int, parent: int, place: pin.SE3) -> tuple[int, pin.SE3]:
        """Add a joint; ``place`` is the body in the parent joint's frame before the joint, the result is that after."""
        m, kinds = self.m, self.lib.mjtJoint
        at, axis = pose(m.jnt_pos[j]), np.array(m.jnt_axis[j])
        ref, after = float(m.qpos0[m.jnt_qposadr[j]]), at.inverse()
        match kinds(m.jnt_type[j]):
            case kinds.mjJNT_FREE:
                place, joint, after = pin.SE3.Identity(), pin.JointModelFreeFlyer(), pin.SE3.Identity()
            case kinds.mjJNT_BALL:
                place, joint = place * at, pin.JointModelSpherical()
            case kinds.mjJNT_HINGE:
                place = place * at * pin.SE3(pin.exp3(-ref * axis), np.zeros(3))
                joint = pin.JointModelRevoluteUnaligned(axis)
            case kinds.mjJNT_SLIDE:
                place = place * at * pose(-ref * axis)
                joint = pin.JointModelPrismaticUnaligned(axis)
        self.before.append((parent, place))
        number = self.model.addJoint(parent, joint, place, self.joints[j])
        new = self.model.joints[number]
        ours, theirs = slice(new.idx_v, new.idx_v + new.nv), slice(m.jnt_dofadr[j], m.jnt_dofadr[j] + new.nv)
        self.model.armature[ours] = m.dof_armature[theirs]
        if new.nv == 6:  # in space, as a weightless mass at the origin: Pinocchio's would rotate with the body
            self.model.armature[ours.start : ours.start + 3] = 0
            origin = pin.Inertia(m.dof_armature[theirs.start], np.zeros(3), np.zeros((3, 3)))
            self.model.appendBodyToJoint(number, origin, pin.SE3.Identity())
        if m.jnt_limited[j] and new.nq == 1:
            (self.model.lowerPositionLimit[new.idx_q], self.model.upperPositionLimit[new.idx_q]) = m.jnt_range[j]
        self.model.upperDryFrictionLimit[ours] = m.dof_frictionloss[theirs]
        self.model.lowerDryFrictionLimit[ours] = -m.dof_frictionloss[theirs]
        if not self.disables("DAMPER"):
            self.model.damping[ours] = m.dof_damping[theirs]
        return number, after
