"""Mechanisms built on Pinocchio models. Only this package imports pinocchio."""

from ..discovery import model_names
from ..errors import NotCompiled
from .closures.closure import Closure
from .closures.clutch import Clutch
from .closures.driver import Driver
from .closures.unilateral_constraint import Stop
from .forces import NAMES
from .formats.joint_tree import depth_first
from .formats.mechanism_file.description import describe, restore
from .formats.mechanism_file.load import ModelSource, load
from .formats.mjcf.states import from_mujoco, to_mujoco
from .formulations.compiled_systems import CompiledSystem
from .hybrid.impact import Impact
from .hybrid.reset import Reset
from .mechanism import Mechanism
from .signals.contacts import Contact, contact
from .signals.joint_wrenches import joint_reaction, point_reactions, reaction_names, reaction_wrenches
from .signals.reactions import Effort, Reaction, effort, reaction, redundant
from .singularity import Singular
from .time_functions.input_functions import Input
from .time_functions.time_functions import Function

globals().update(NAMES)  # every force is public, by discovery

__all__ = [
    "Clutch",
    "Closure",
    "CompiledSystem",
    "Contact",
    "Driver",
    "Effort",
    "Function",
    "Impact",
    "Input",
    "Mechanism",
    "ModelSource",
    "NotCompiled",
    "Reaction",
    "Singular",
    "Reset",
    "Stop",
    "contact",
    "depth_first",
    "describe",
    "effort",
    "from_mujoco",
    "joint_reaction",
    "load",
    "reaction_names",
    "reaction_wrenches",
    "model_names",
    "point_reactions",
    "reaction",
    "redundant",
    "restore",
    "to_mujoco",
    *NAMES,
]
