"""A compiled MuJoCo model, and the Pinocchio model of its tree."""

from collections.abc import Iterable
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin

from .states import pose

RESERVED = ("world", "universe")  # names of the ground
LIMIT_FLAGS, FRICTION_FLAGS = ("LIMIT", "CONSTRAINT"), ("FRICTIONLOSS", "CONSTRAINT")  # each disables these terms


class MjcfModel:
    """A compiled MuJoCo model with names for all objects, and the Pinocchio model built from it.

    Attributes:
        lib: the mujoco package.
        m: the mujoco.MjModel.
        model: the Pinocchio model.
        carriers: joint of each MuJoCo body, and the placement of the body in the joint frame.
        joint_parents: parent joint of each MuJoCo joint, and its placement in the parent joint.
        joints: name of each MuJoCo joint in Pinocchio.
        sites: name of the frame of each MuJoCo site.
        actuators: name of each MuJoCo actuator.
    """

    def __init__(self, lib: ModuleType, m: Any, name: str) -> None:
        self.lib, self.m = lib, m
        self.model = pin.Model()
        self.model.name = name
        self.carriers: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
        self.joint_parents: list[tuple[int, pin.SE3]] = []
        self.joints = self.names("JOINT", "joint", range(m.njnt), set(RESERVED))
        self._taken = set(RESERVED)  # names of frames, which may share names with joints
        for b, body in enumerate(self.names("BODY", "body", range(1, m.nbody), self._taken), 1):
            self._add_body(b, body)
        self.sites = self.names("SITE", "site", range(m.nsite), self._taken)
        self.actuators = self.names("ACTUATOR", "actuator", range(len(m.actuator_trntype)), set())
        for s, site in enumerate(self.sites):
            self.add_frame(site, m.site_bodyid[s], m.site_pos[s], m.site_quat[s])

    def name(self, kind: str, i: int) -> str:
        """Return the name from the file, or an empty one."""
        return self.lib.mj_id2name(self.m, getattr(self.lib.mjtObj, f"mjOBJ_{kind}"), i) or ""

    def names(self, kind: str, word: str, numbers: Iterable[int], taken: set[str]) -> list[str]:
        """Return distinct names of objects: from the file, or else the word and the number.

        Args:
            kind: kind of the objects in MuJoCo.
            word: word for objects without a name.
            numbers: numbers of the objects.
            taken: names already in use, to which the returned names are added.
        """
        given = {i: self.name(kind, i) for i in numbers}
        found = {i: _distinct(name, taken) for i, name in given.items() if name}  # named ones first: the file uses them
        return [found[i] if i in found else _distinct(f"{word}{i}", taken) for i in given]

    def disables(self, *flags: str) -> bool:
        """Return whether the options of the file disable a term of the dynamics, by one of several flags."""
        bits = self.lib.mjtDisableBit
        if not hasattr(bits, "mjDSBL_SPRING"):  # MuJoCo 3.3 has one flag for springs and dampers
            flags = tuple("PASSIVE" if flag in ("SPRING", "DAMPER") else flag for flag in flags)
        return any(self.m.opt.disableflags & getattr(bits, f"mjDSBL_{flag}") for flag in flags)

    def is_scalar(self, j: int) -> bool:
        """Return whether a MuJoCo joint is a hinge or a slide."""
        kinds = self.lib.mjtJoint
        return kinds(self.m.jnt_type[j]) in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)

    def unique(self, name: str) -> str:
        """Return a frame name that is not used yet."""
        return _distinct(name, self._taken)

    def add_frame(self, name: str, body: int, position: np.ndarray, quaternion: np.ndarray | None = None) -> str:
        """Add a frame on a MuJoCo body; return its name."""
        joint, placement = self.carriers[body]
        in_joint = placement * pose(position, quaternion)
        self.model.addFrame(pin.Frame(name, joint, in_joint, pin.FrameType.OP_FRAME))
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
        """Add a joint at the placement of its body in the parent joint; return its number, and the body's placement."""
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
        if new.nv == 6:  # as a mass without weight at the origin: Pinocchio's armature would rotate with the body
            self.model.armature[pin_rows.start : pin_rows.start + 3] = 0
            origin = pin.Inertia(m.dof_armature[mujoco_rows.start], np.zeros(3), np.zeros((3, 3)))
            self.model.appendBodyToJoint(number, origin, pin.SE3.Identity())
        if m.jnt_limited[j] and new.nq == 1 and not self.disables(*LIMIT_FLAGS):
            (self.model.lowerPositionLimit[new.idx_q], self.model.upperPositionLimit[new.idx_q]) = m.jnt_range[j]
        if not self.disables(*FRICTION_FLAGS):
            self.model.upperDryFrictionLimit[pin_rows] = m.dof_frictionloss[mujoco_rows]
            self.model.lowerDryFrictionLimit[pin_rows] = -m.dof_frictionloss[mujoco_rows]
        if not self.disables("DAMPER"):
            self.model.damping[pin_rows] = m.dof_damping[mujoco_rows]
        return number, after


def _distinct(name: str, taken: set[str]) -> str:
    """Return a name, with a number if it is taken, and add it to the taken names."""
    new, k = name, 2
    while new in taken:
        new, k = f"{name}_{k}", k + 1
    taken.add(new)
    return new
