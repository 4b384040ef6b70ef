"""Force laws and controllers, one file each, from the user's description to generalised forces."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Union

import numpy as np
import pinocchio as pin
from pydantic import Field
from pydantic_core import PydanticUndefined

from ...discovery import members, plugins
from ...errors import InputError
from ..frames import find_joint
from .elements import ForceElements
from .force import Force, PythonForce
from .joint_damping import JointDamping, damping_law
from .joint_friction import HeldJoint, JointFriction
from .torque_function import TorqueElement

_FOUND: list[type] = list(dict.fromkeys(members(__name__, type)))
_KINDS = {c.__name__ for c in _FOUND} | {c.model_fields["kind"].default for c in _FOUND if issubclass(c, Force)}


def _new(value: Any) -> bool:
    if not isinstance(value, type) or not issubclass(value, Force | PythonForce) or value.__name__ in _KINDS:
        return False
    return not issubclass(value, Force) or value.model_fields["kind"].default not in {PydanticUndefined, *_KINDS}


_FOUND += plugins("mbdae.forces", _new, "a class of forces with a kind and name of its own").values()
FORCES: tuple[type[Force], ...] = tuple(c for c in _FOUND if issubclass(c, Force) and c is not Force)
"""Every force of files, found in the files of this folder."""
PYTHON_FORCES = tuple(c for c in _FOUND if issubclass(c, PythonForce) and c is not PythonForce)
NAMES = {c.__name__: c for c in (*FORCES, *PYTHON_FORCES)}

if TYPE_CHECKING:
    AnyForce = Force
else:
    AnyForce = Annotated[Union[FORCES], Field(discriminator="kind")]  # noqa: UP007


def named_force(force: Any, i: int) -> Any:
    """Return a force, the i-th of a mechanism, with a name: a described one without a name gets its kind and number.

    Raises:
        InputError: if it is not a force.
    """
    if callable(force) or isinstance(force, PYTHON_FORCES):
        return force
    if not isinstance(force, FORCES):
        kinds = ", ".join(f.__name__ for f in (*FORCES, *PYTHON_FORCES))
        raise InputError(f"a force is a function tau(t, q, v) or one of {kinds}, got {type(force).__name__}")
    return force if force.name else force.model_copy(update={"name": f"{force.kind} {i + 1}"})


def stiction_joints(model: pin.Model, forces: Sequence[Any]) -> tuple[HeldJoint, ...]:
    """Return the joints with exact dry friction.

    Raises:
        UnknownNameError, InputError: for unknown or unsuitable joints, or joints with two frictions.
    """
    found = tuple(h for f in forces if isinstance(f, JointFriction) for h in f.holds(model))
    for name in {b.joint for b in found if [x.joint for x in found].count(b.joint) > 1}:
        raise InputError(f"joint {name!r} has two frictions that stick")
    return found


def is_custom(force: Any) -> bool:
    """Return whether a force is bound by code outside mbdae, which may call any algorithm on the workspace."""
    return hasattr(force, "bind") and type(force).__module__.partition(".")[0] != "mbdae"


def bind_forces(forces: Sequence[Any], model: pin.Model, data: pin.Data) -> ForceElements:
    """Bind forces to a workspace, and the model's own damping where no joint_damping replaces it.

    Raises:
        UnknownNameError, InputError: for unknown or unsuitable frames and joints.
    """
    laws = [TorqueElement(f, model) if callable(f) else f.bind(model, data) for f in forces]
    damping, seen = np.array(model.damping), set[str]()
    for f in forces:
        if isinstance(f, JointDamping):
            for name in [f.joint] if isinstance(f.joint, str) else f.joint:
                if name in seen:
                    raise InputError(f"joint {name!r} has two joint_damping forces")
                seen.add(name)
                j = find_joint(model, name)
                damping[j.idx_v : j.idx_v + j.nv] = 0
    return ForceElements([*laws, damping_law("joint damping", damping)] if damping.any() else laws, model)
