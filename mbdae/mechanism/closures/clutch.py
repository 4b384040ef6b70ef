"""Clutches between joints, one-way, ratchets or commanded: rows that are active while they lock."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import pinocchio as pin
from pydantic import Field, model_validator

from ...errors import InputError
from ..key_units import Unit
from ..time_functions.time_functions import Steps
from .joint_pair import JointPair
from .joint_rows import BoundCoordinateRow, BoundJointRow, JointRow, Ratio


class Clutch(JointPair):
    """A clutch: one-way, ratchet or commanded.

    A one-way clutch lets a joint overrun another one, or the ground, in one direction only,

        direction (v_i - ratio v_j) >= 0, and the locking torque acts in that direction only

    Without ``pitch`` (freewheel, sprag clutch) it locks at once. With ``pitch`` it is a ratchet: its pawl engages at
    q_i - ratio q_j = tooth + k pitch, and the joint runs back at most to the last of these positions.

    With ``engaged`` it is a commanded clutch: it locks in both directions, v_i = ratio v_j, while the command is
    positive. Engagement at different speeds is an impact.

    Attributes:
        joint: name of a joint of one coordinate, against the ground; or
        joints: names of joints i and j.
        direction: direction in which joint i overruns: 1 forwards, -1 backwards.
        ratio: speed ratio v_i / v_j when locked; 1 when left out.
        pitch: pitch of the teeth of a ratchet, in rad or m of joint i.
        tooth: position of one tooth, in rad or m.
        engaged: command, a step function of time, positive while the clutch is engaged.
        name: name of the clutch; by default the names of the joints and "clutch".

    Raises:
        InputError: for an unknown key or a wrong value, in one line with what is expected; when a mechanism is created,
            for teeth on an unbounded joint.
        UnknownNameError: when a mechanism is created, for an unknown joint.
    """

    direction: Literal[1, -1] = 1
    ratio: Annotated[float | None, Unit("q/q1")] = None
    pitch: Annotated[float | None, Unit("q")] = Field(default=None, gt=0)
    tooth: Annotated[float, Unit("q")] = 0.0
    engaged: Annotated[Steps | None, Unit("1")] = None
    name: str = ""

    @model_validator(mode="after")
    def _check_keys(self) -> "Clutch":
        if (self.joint is None) == (self.joints is None):
            raise ValueError("a clutch needs one of joint and joints")
        if self.joint is not None and self.ratio is not None:
            raise ValueError("ratio belongs to a clutch of two joints")
        if self.pitch is None and self.tooth:
            raise ValueError("tooth belongs to a ratchet, which has a pitch")
        if self.engaged and (self.pitch is not None or self.direction != 1):
            raise ValueError("direction and pitch belong to one-way clutches, a clutch with engaged locks both ways")
        if not self.name:
            object.__setattr__(self, "name", "-".join(self.between) + " clutch")
        return self

    @property
    def m(self) -> int:
        """Number of rows: 1."""
        return 1

    def primitives(self) -> "Sequence[Ratio] | Sequence[ToothRow]":
        """The row."""
        (joint, other), ratio = self.joints or (self.joint or "", ""), 1.0 if self.ratio is None else self.ratio
        if self.pitch is None:
            return [Ratio(joint, other, "", (ratio,))]
        return [ToothRow(joint, other, (self.tooth, ratio) if other else (self.tooth,), self.pitch)]


@dataclass(frozen=True)
class ToothRow(JointRow):
    """Row g = q_i - c_0 - c_1 q_j modulo a pitch: the pawl of a ratchet at a tooth.

    Attributes:
        joint: name of joint i.
        other: name of joint j; without one the row is g = q_i - c_0.
        coefficients: c_0 in rad or m, and the ratio c_1.
        pitch: pitch of the teeth in rad or m.
    """

    joint: str
    other: str
    coefficients: tuple[float, ...]
    pitch: float

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundToothRow":
        return BoundToothRow(model, data, self, at, name)


class BoundToothRow(BoundCoordinateRow):
    """g = x_i - p(x_j) up to multiples of a pitch.

    Raises:
        InputError: for an unbounded joint.
    """

    def __init__(self, model: pin.Model, data: pin.Data, row: ToothRow, at: int, name: str) -> None:
        BoundJointRow.__init__(self, model, data, (row.joint, row.other), at, name, row.coefficients)
        if any(j.nq > 1 for j in self.joints):
            raise InputError(f"{name!r}: the angle of an unbounded joint does not determine the next tooth; bound it")
        self.period = row.pitch
