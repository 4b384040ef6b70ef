"""What moves: mechanisms over Pinocchio models. The only place that imports pinocchio."""

from ..errors import NotCompiled
from .closures.closure import Closure
from .closures.driver import Driver
from .forces.actuator import Actuator
from .forces.bushing import Bushing
from .forces.dc_motor import DCMotor
from .forces.joint_damping import JointDamping
from .forces.joint_friction import JointFriction
from .forces.joint_pid import JointPID
from .forces.joint_spring import JointSpring
from .forces.joint_torque import JointTorque
from .forces.sampled import Sampled
from .forces.spring_damper import SpringDamper
from .forces.wrench import Wrench
from .formats.library import model_names
from .formats.load import describe, load, restore
from .formats.mjcf.states import from_mujoco, to_mujoco
from .formats.tree import depth_first
from .formulations.compiled import Compiled
from .mechanism import Mechanism
from .reactions import Effort, Reaction, effort, reaction, redundant
from .signals import Function
from .singularity import Singular

__all__ = [
    "Actuator",
    "Bushing",
    "Closure",
    "Compiled",
    "DCMotor",
    "Driver",
    "Effort",
    "Function",
    "JointDamping",
    "JointFriction",
    "JointPID",
    "JointSpring",
    "JointTorque",
    "Mechanism",
    "NotCompiled",
    "Reaction",
    "Sampled",
    "Singular",
    "SpringDamper",
    "Wrench",
    "depth_first",
    "describe",
    "effort",
    "from_mujoco",
    "load",
    "model_names",
    "reaction",
    "redundant",
    "restore",
    "to_mujoco",
]
