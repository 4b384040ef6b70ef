"""What moves: mechanisms over Pinocchio models. The only place that imports pinocchio."""

from .closures.closure import Closure
from .closures.driver import Driver
from .forces.force import (
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
from .formats.library import model_names
from .formats.load import describe, load, restore
from .formats.mjcf.states import from_mujoco, to_mujoco
from .formats.tree import depth_first
from .formulations.compiled import Compiled
from .formulations.compiled_parts import NotCompiled
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
