"""Viscous friction in joints."""

from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field

from ..key_units import Unit
from ..tree.frames import find_joints
from .force import Array, Force, ForceElement, Joints
from .linear import LinearElement


class JointDamping(Force):
    """tau = -damping * v on each coordinate of the joints; replaces the damping of the imported model.

    Attributes:
        joint: one joint or several.
        damping: damping coefficient in N m s/rad or N s/m.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["joint_damping"] = "joint_damping"
    joint: Joints
    damping: Annotated[float, Unit("e s/q")] = Field(ge=0)

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        d = np.zeros(model.nv)
        for j in find_joints(model, self.joint):
            d[j.idx_v : j.idx_v + j.nv] = self.damping
        return damping_law(self.name, d)


def damping_law(name: str, d: Array) -> LinearElement:
    """Return the law tau = -d * v with damping coefficients d (nv,)."""
    return LinearElement(name, [("tau", i, "v", i, -float(d[i])) for i in np.flatnonzero(d).tolist()])
