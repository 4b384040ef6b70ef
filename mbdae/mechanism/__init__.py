"""What moves: mechanisms over Pinocchio models. The only place that imports pinocchio."""

from .closures import Closure
from .compiled import Compiled
from .compiled_parts import NotCompiled
from .drivers import Driver
from .forces import (
    Actuator,
    Bushing,
    DCMotor,
    JointDamping,
    JointFriction,
    JointPID,
    JointSpring,
    JointTorque,
    Sampled,
    SpringDamper,
    Wrench,
)
from .library import model_names
from .load import describe, load, restore
from .mechanism import Mechanism
from .mujoco_state import from_mujoco, to_mujoco
from .reactions import Effort, Reaction, effort, reaction, redundant
from .signals import Function
from .singular import Singular
from .tree import depth_first

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
