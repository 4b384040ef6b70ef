"""Actuators and springs of an MJCF file."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...forces.bushing import Bushing
from ...forces.joint_spring import JointSpring
from ...model_settings import Motor
from .states import pose

if TYPE_CHECKING:
    from .compiled_model import MjcfModel


class MjcfActuators(NamedTuple):
    """Actuators of an MJCF file.

    Attributes:
        motors: motors by the index of their control.
        unsupported: names of unsupported actuators.
        limited: names of motors whose limits or delays are not carried over.
    """

    motors: dict[int, Motor]
    unsupported: list[str]
    limited: list[str]


def actuators_of(c: "MjcfModel") -> MjcfActuators:
    """Return the actuators on hinges and slides with force gain u + b_0 + b_1 length + b_2 velocity.

    These are motor, position, velocity, and general with affine bias, with the length of the transmission. With
    length = gear q the effort on the joint is gear times the force, gear gain u + gear b_0 +
    gear^2 (b_1 q + b_2 v): the gear of the motor is gear gain.
    """
    m, lib = c.m, c.lib
    motors: dict[int, Motor] = {}
    unsupported, limited = [], []
    for i in range(len(m.actuator_trntype)):
        name, joint = c.actuators[i], _scalar_joint(c, i)
        bias = lib.mjtBias(m.actuator_biastype[i])
        is_affine = (
            lib.mjtGain(m.actuator_gaintype[i]) in (lib.mjtGain.mjGAIN_FIXED, lib.mjtGain.mjGAIN_AFFINE)
            and not (m.actuator_gaintype[i] and m.actuator_gainprm[i, 1:3].any())
            and bias in (lib.mjtBias.mjBIAS_NONE, lib.mjtBias.mjBIAS_AFFINE)
            and lib.mjtDyn(m.actuator_dyntype[i]) == lib.mjtDyn.mjDYN_NONE
            and m.actuator_plugin[i] < 0
        )
        gear = float(m.actuator_gear[_address(m, "actuator_outadr", i), 0])
        if joint is not None:
            _add_reflected_inertia(c, i, joint, gear)
        if not _is_enabled(c, i):
            unsupported.append(f"{name} (not active)")
        elif joint is not None and is_affine:
            control = _address(m, "actuator_ctrladr", i)
            b = m.actuator_biasprm[i, :3] if bias == lib.mjtBias.mjBIAS_AFFINE else np.zeros(3)
            b = (b * [gear, gear**2, gear**2]).tolist()
            motors[control] = Motor(name, c.joints[joint], gear * float(m.actuator_gainprm[i, 0]), tuple(b))
            if _is_limited(c, i, control, joint):
                limited.append(name)
        else:
            unsupported.append(name if m.actuator_plugin[i] < 0 else f"{name} (plugin)")
    return MjcfActuators(motors, unsupported, limited)


def _is_enabled(c: "MjcfModel", i: int) -> bool:
    """Return whether an actuator is enabled by the options of the file."""
    group = int(c.m.actuator_group[i])
    return not c.disables("ACTUATION") and not (0 <= group < 31 and int(c.m.opt.disableactuator) >> group & 1)


def _is_limited(c: "MjcfModel", i: int, control: int, joint: int) -> bool:
    """Return whether MuJoCo limits the control of a motor, its force, or the force of its joint, or delays it."""
    m = c.m
    clipped = m.actuator_ctrllimited[control] and not c.disables("CLAMPCTRL")
    delayed = hasattr(m, "actuator_delay") and np.any(m.actuator_delay[i])
    return bool(clipped or delayed or m.actuator_forcelimited[i] or m.jnt_actfrclimited[joint])


def _scalar_joint(c: "MjcfModel", i: int) -> int | None:
    """Return the hinge or slide on which an actuator acts; None for any other transmission."""
    transmission, joint = c.lib.mjtTrn(c.m.actuator_trntype[i]), int(c.m.actuator_trnid[i, 0])
    if transmission not in (c.lib.mjtTrn.mjTRN_JOINT, c.lib.mjtTrn.mjTRN_JOINTINPARENT):
        return None
    return joint if c.is_scalar(joint) else None


def _address(m: Any, array: str, i: int) -> int:
    """Return the index of an actuator's values; actuators of MuJoCo 4 may have several controls."""
    return int(getattr(m, array)[i]) if hasattr(m, array) else i


def _add_reflected_inertia(c: "MjcfModel", i: int, joint: int, gear: float) -> None:
    """Add armature and damping of an actuator to its joint (MuJoCo 4)."""
    m = c.m
    if hasattr(m, "jnt_actuatorid") and m.jnt_actuatorid[joint] == i:
        iv = c.model.joints[c.model.getJointId(c.joints[joint])].idx_v
        c.model.armature[iv] += gear**2 * m.actuator_armature[i]
        if not c.disables("DAMPER"):
            c.model.damping[iv] += gear**2 * m.actuator_damping[i]


def springs_of(c: "MjcfModel") -> list[JointSpring | Bushing]:
    """Return springs of hinges and slides, and bushings of equal stiffnesses for springs of ball and free joints."""
    m = c.m
    out: list[JointSpring | Bushing] = []
    for j in np.flatnonzero(m.jnt_stiffness).tolist() if not c.disables("SPRING") else ():
        name, rest, k = f"{c.joints[j]} spring", m.qpos_spring[m.jnt_qposadr[j] :], float(m.jnt_stiffness[j])
        if c.is_scalar(j):
            out.append(JointSpring(name=name, joint=c.joints[j], stiffness=k, rest=float(rest[0])))
            continue
        free = c.lib.mjtJoint(m.jnt_type[j]) == c.lib.mjtJoint.mjJNT_FREE
        parent, placement = c.joint_parents[j]
        rest_placement = placement * (pose(rest[:3], rest[3:7]) if free else pose(np.zeros(3), rest[:4]))
        child = c.model.getJointId(c.joints[j])
        frames = (c.unique(f"{name}.1"), c.unique(f"{name}.2"))
        for frame, joint, location in zip(frames, (parent, child), (rest_placement, pin.SE3.Identity()), strict=True):
            c.model.addFrame(pin.Frame(frame, joint, location, pin.FrameType.OP_FRAME))
        out.append(Bushing(name=name, frames=frames, stiffness=(k if free else 0.0,) * 3 + (k,) * 3))
    return out


def weightless_masses(c: "MjcfModel") -> dict[str, float]:
    """Return frames and masses for the armature of free joints, which has inertia but no weight."""
    m, out = c.m, {}
    for j in range(m.njnt):
        mass = float(m.dof_armature[m.jnt_dofadr[j]])
        if c.lib.mjtJoint(m.jnt_type[j]) == c.lib.mjtJoint.mjJNT_FREE and mass:
            out[c.add_frame(c.unique(f"{c.joints[j]} armature"), m.jnt_bodyid[j], np.zeros(3))] = mass
    return out
