"""All forces: those that stand in a file, by kind, and those that are Python objects."""

from collections.abc import Sequence
from typing import Annotated, Any, Union

import numpy as np
import pinocchio as pin
from pydantic import Field

from ...errors import InputError
from ..callbacks import function_name
from ..frames import find_joint
from .actuators import Actuator, DCMotor
from .controllers import JointPID, Sampled
from .frame_forces import Bushing, SpringDamper, Wrench
from .joint_forces import DampingLaw, JointDamping, JointFriction, JointSpring, JointTorque, SpringLaw
from .law import Force, Law, Laws, StateLaw, TorqueFunction, TorqueLaw

FORCES: tuple[type[Force], ...] = (
    JointSpring,
    JointDamping,
    JointFriction,
    JointTorque,
    JointPID,
    DCMotor,
    SpringDamper,
    Bushing,
    Wrench,
)
AnyForce = Annotated[
    Union[  # noqa: UP007
        JointSpring, JointDamping, JointFriction, JointTorque, JointPID, DCMotor, SpringDamper, Bushing, Wrench
    ],
    Field(discriminator="kind"),
]
PYTHON_FORCES: tuple[type[Any], ...] = (Actuator, Sampled)

__all__ = [
    "FORCES",
    "PYTHON_FORCES",
    "Actuator",
    "AnyForce",
    "Bushing",
    "DCMotor",
    "DampingLaw",
    "Force",
    "JointDamping",
    "JointFriction",
    "JointPID",
    "JointSpring",
    "JointTorque",
    "Law",
    "Laws",
    "Sampled",
    "SpringDamper",
    "SpringLaw",
    "StateLaw",
    "TorqueFunction",
    "TorqueLaw",
    "Wrench",
    "bind_forces",
    "named_force",
]


def named_force(force: Any, i: int) -> Any:
    """Return a force, the i-th of a mechanism, with a name: a described one gets its kind and number if it has none.

    Raises:
        InputError: for what is no force.
    """
    if callable(force) or isinstance(force, PYTHON_FORCES):
        return force
    if not isinstance(force, FORCES):
        kinds = ", ".join(f.__name__ for f in (*FORCES, *PYTHON_FORCES))
        raise InputError(f"a force is a function tau(t, q, v) or one of {kinds}, got {type(force).__name__}")
    return force if force.name else force.model_copy(update={"name": f"{force.kind} {i + 1}"})


def bind_forces(forces: Sequence[Any], model: pin.Model, data: pin.Data) -> Laws:
    """Bind forces to a workspace; the model's own damping counts where no joint_damping replaces it.

    Raises:
        UnknownNameError, InputError: for frames and joints that do not exist or do not fit.
    """
    laws = [TorqueLaw(function_name(f), f) if callable(f) else f.bind(model, data) for f in forces]
    damping, seen = np.array(model.damping), set[str]()
    for f in forces:
        if isinstance(f, JointDamping):
            for name in [f.joint] if isinstance(f.joint, str) else f.joint:
                if name in seen:
                    raise InputError(f"joint {name!r} has two joint_damping forces")
                seen.add(name)
                j = find_joint(model, name)
                damping[j.idx_v : j.idx_v + j.nv] = 0
    return Laws([*laws, DampingLaw("URDF damping", damping)] if damping.any() else laws, model.nv)
