"""Force laws and controllers, one file each: the user's description, and its generalized force."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Union

import numpy as np
import pinocchio as pin
from pydantic_core import PydanticUndefined

from ...discovery import members, plugins
from ...errors import InputError, require
from ..tagged_union import TaggedByKind
from ..time_functions.input_functions import as_input, inputs_in
from ..tree.frames import find_joint
from .elements import ForceElements
from .fmu import FMU, fmu_by_input
from .force import Force, PythonForce
from .joint_damping import JointDamping, damping_law
from .joint_friction import JointFriction, StictionJoint
from .modal_elasticity import modal_elasticity
from .torque_function import TorqueElement, TorqueFunction

_FOUND: list[type] = list(dict.fromkeys(members(__name__, type)))
_KINDS = {c.__name__ for c in _FOUND} | {c.model_fields["kind"].default for c in _FOUND if issubclass(c, Force)}


def _is_new(value: object) -> bool:
    if not isinstance(value, type) or not issubclass(value, Force | PythonForce) or value.__name__ in _KINDS:
        return False
    return not issubclass(value, Force) or value.model_fields["kind"].default not in {PydanticUndefined, *_KINDS}


_FOUND += plugins("mbdae.forces", _is_new, "a class of forces with a new kind and name").values()
FORCES: tuple[type[Force], ...] = tuple(c for c in _FOUND if issubclass(c, Force) and c is not Force)
"""All kinds of forces that files can describe, one file of this folder each."""
PYTHON_FORCES = tuple(c for c in _FOUND if issubclass(c, PythonForce) and c is not PythonForce)
NAMES = {c.__name__: c for c in (*FORCES, *PYTHON_FORCES)}

if TYPE_CHECKING:
    from ..closures.driver import Driver
    from ..mechanism import Mechanism

    AnyForce = Force
else:
    AnyForce = Annotated[Union[FORCES], TaggedByKind()]  # noqa: UP007

MechanismForce = Force | PythonForce | TorqueFunction


def named_force(force: object, i: int) -> MechanismForce:
    """Return the i-th force of a mechanism; one without a name gets its kind and number as name.

    Raises:
        InputError: for anything other than a force.
    """
    if isinstance(force, PYTHON_FORCES) or (callable(force) and not isinstance(force, type)):
        return force
    if not isinstance(force, FORCES):
        kinds = ", ".join(f.__name__ for f in (*FORCES, *PYTHON_FORCES))
        got = f"the class {force.__name__}" if isinstance(force, type) else type(force).__name__
        raise InputError(f"a force is a function tau(t, q, v) or one of {kinds}, got {got}")
    return force if force.name else force.model_copy(update={"name": f"{force.kind} {i + 1}"})


def named_forces(forces: Sequence[object], drivers: "Sequence[Driver]") -> tuple[MechanismForce, ...]:
    """Return the forces of a mechanism with their names; FMUs receive the inputs that they may set.

    Raises:
        InputError: for anything other than a force, or inputs that outputs of FMUs cannot set.
    """
    require(forces, Sequence, "forces are a list")
    found = tuple(named_force(f, i) for i, f in enumerate(forces))
    if not any(isinstance(f, FMU) for f in found):
        return found
    inputs = {name: as_input(x) for name, x in inputs_in([*found, *drivers]).items()}
    found = tuple(f.with_inputs(inputs) if isinstance(f, FMU) else f for f in found)
    set_by_fmus = fmu_by_input(found)
    for driver in drivers:
        if getattr(driver.path, "name", "") in set_by_fmus:
            driver.require_continuous()
    return found


def stiction_joints(model: pin.Model, forces: Sequence[object]) -> tuple[StictionJoint, ...]:
    """Return the joints with exact Coulomb friction.

    Raises:
        UnknownNameError, InputError: for unknown or unsuitable joints, or joints with two exact friction forces.
    """
    found = tuple(h for f in forces if isinstance(f, JointFriction) for h in f.stiction_joints(model))
    for name in {b.joint for b in found if [x.joint for x in found].count(b.joint) > 1}:
        raise InputError(f"joint {name!r} has two exact friction forces")
    return found


def require_signals(mech: "Mechanism") -> None:
    """Check that the signals named by forces exist.

    Raises:
        UnknownNameError, InputError: for unknown or unsuitable signals.
    """
    for force in mech.forces:
        if isinstance(force, Force):
            force.require_signals(mech)


def is_custom(force: object) -> bool:
    """Return whether a force is bound by code outside mbdae, which may call any Pinocchio algorithm."""
    return hasattr(force, "bind") and type(force).__module__.partition(".")[0] != "mbdae"


def bind_forces(
    forces: Sequence[MechanismForce], model: pin.Model, data: pin.Data, elastic: pin.Model | None = None
) -> ForceElements:
    """Bind forces, elasticity of flexible bodies, and damping of the model for joints without a joint_damping.

    Args:
        forces: the forces.
        model: the model.
        data: a workspace of it.
        elastic: the model whose flexible bodies are elastic, in place of ``model``.

    Raises:
        UnknownNameError, InputError: for unknown or unsuitable frames and joints.
    """
    laws = [TorqueElement(f, model) if callable(f) else f.bind(model, data) for f in forces]
    laws += modal_elasticity(elastic or model)
    damping, replaced = np.array(model.damping), set[str]()
    for f in forces:
        if isinstance(f, JointDamping):
            for name in [f.joint] if isinstance(f.joint, str) else f.joint:
                if name in replaced:
                    raise InputError(f"joint {name!r} has two joint_damping forces")
                replaced.add(name)
                j = find_joint(model, name)
                damping[j.idx_v : j.idx_v + j.nv] = 0
    return ForceElements([*laws, damping_law("joint damping", damping)] if damping.any() else laws, model)
