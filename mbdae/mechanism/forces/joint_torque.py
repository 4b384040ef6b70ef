"""Joint torques as functions of time."""

from typing import Annotated, Literal

import pinocchio as pin

from ...errors import InputError
from ..key_units import Unit
from ..time_functions.time_functions import TimeFunction
from ..tree.frames import find_joint
from .force import Force, ForceElement, single_coordinate_joints, single_velocity_joint
from .linear import LinearElement, Term


class JointTorque(Force):
    """A torque (N m) or force (N) on a joint, one for each of its nv coordinates: tau_k = gear torque_k(t).

    With a bias tau = gear torque(t) + b_0 + b_1 q + b_2 v, like the actuators of MJCF files: b_1 < 0 controls the
    position.

    Attributes:
        joint: one joint.
        torque: one constant or function of time, or nv of them.
        gear: common factor of the torques.
        bias: b_0, b_1, b_2 of a joint of one velocity, in N m or N; per rad or m; per rad/s or m/s. A continuous joint
            has no b_1: its angle is known only up to full revolutions.
        name: name in parameters, signals and messages; the kind and a number if omitted.

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected.
        UnknownNameError: when a mechanism is created, for an unknown joint or frame.
    """

    kind: Literal["joint_torque"] = "joint_torque"
    joint: str
    torque: Annotated[TimeFunction | tuple[TimeFunction, ...], Unit("e")]
    gear: Annotated[float, Unit("1")] = 1.0
    bias: Annotated[tuple[float, float, float], Unit("e", "e/q", "e s/q")] = (0.0, 0.0, 0.0)

    def bind(self, model: pin.Model, data: pin.Data) -> ForceElement:
        j = find_joint(model, self.joint)
        values = self.torque if isinstance(self.torque, tuple) else (self.torque,)
        if len(values) != j.nv:
            raise InputError(f"joint {self.joint!r} takes {j.nv} torque values, got {len(values)}")
        terms: list[Term] = [("tau", j.idx_v + i, "u", i, self.gear) for i in range(j.nv)]
        if any(self.bias):
            what = f"joint_torque {self.name!r} with a bias"
            if self.bias[1]:
                single_coordinate_joints(model, self.joint, what)
            single_velocity_joint(model, self.joint, what)
            columns = (("1", 0), ("q", j.idx_q), ("v", j.idx_v))
            biases = zip(columns, self.bias, strict=True)
            terms += [("tau", j.idx_v, column, x, b) for (column, x), b in biases if column != "q" or j.nq == 1]
        return LinearElement(self.name, terms, time_functions=values)
