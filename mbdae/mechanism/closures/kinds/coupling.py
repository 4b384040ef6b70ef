"""The coupling closure: joint coordinates that depend on others, by a polynomial, a sum or a motion law."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from ....data_types import CoreData
from ....errors import InputError
from ....system import Array
from ....tolerances import COINCIDENT
from ...key_units import Coordinates, Unit
from ...time_functions.time_functions import Harmonic
from ..closure import BetweenJoints
from ..joint_rows import BoundCoordinateRow, BoundJointRow, Coordinate, JointRow, common_period, coordinate
from ..motion_laws import Law, LawTable, law_derivatives, period_of


class CouplingClosure(BetweenJoints):
    """1 row: q_i = c_0 + c_1 q_j + c_2 q_j^2 + ... or q_i = c_0 + c_1 q_j + c_2 q_k + ... or q_i = f(q_j).

    The joints have one coordinate each. Angles of unbounded revolute joints are known up to full revolutions: the
    coupling is evaluated modulo their effect, and rejected if this is not possible (powers, irrational ratios).

    Attributes:
        coefficients: c_0, c_1, ...: those of the powers of q_j for two joints; one per joint for three or more.
        curve: the law f of a coupling of two joints, instead of coefficients (cam laws, indexing drives).
    """

    kind: Literal["coupling"] = "coupling"
    coefficients: Annotated[tuple[float, ...] | None, Unit("q", powers_of="q1")] = Field(default=None, min_length=1)
    curve: Annotated[Law | None, Unit("q", over="q1")] = None

    @model_validator(mode="after")
    def _check_keys(self) -> "CouplingClosure":
        n, joints = len(self.coefficients or ()), len(self.joints)
        if (self.coefficients is None) == (self.curve is None):
            raise ValueError("a coupling needs one of coefficients and curve")
        if self.curve is None and (n != joints if joints > 2 else n == 1):
            raise ValueError("a coupling has at least two coefficients, or one per joint for three joints or more")
        if self.curve and joints > 2:
            raise ValueError("curve belongs to couplings of two joints")
        return self

    @property
    def is_linear(self) -> bool:
        """Whether the coupling can be solved for each of its coordinates, not only for q_i."""
        return self.curve is None and len(self.coefficients or ()) == len(self.joints)

    def unit_of(self, key: str) -> Unit | Coordinates | None:
        if key != "coefficients" or len(self.joints) == 2:
            return super().unit_of(key)
        return Unit("q", *(f"q/q{k}" for k in range(1, len(self.joints))))

    def primitives(self) -> tuple[JointRow]:
        (i, j, *more), c = self.joints, self.coefficients or ()
        if self.curve:
            return (MotionLawRow(i, j, self.curve),)
        return (Sum(self.joints, c) if more else Coordinate(i, j, c),)

    @classmethod
    def create(
        cls, joint: str, other: str | Sequence[str], coefficients: tuple[float, ...], name: str = ""
    ) -> "CouplingClosure":
        """Joint coordinates satisfy q_joint = c_0 + c_1 q_other + c_2 q_other^2 + ..., or a sum over several others."""
        others = (other,) if isinstance(other, str) else other
        return cls(joints=(joint, *others), coefficients=tuple(coefficients), name=name)

    @classmethod
    def law(cls, joint: str, other: str, curve: LawTable | Harmonic, name: str = "") -> "CouplingClosure":
        """Joint coordinates satisfy q_joint = f(q_other)."""
        return cls(joints=(joint, other), curve=curve, name=name)


@dataclass(frozen=True)
class MotionLawRow(JointRow):
    """Row g = q_i - f(q_j) with a motion law f, between joints of one coordinate each.

    Attributes:
        joint: name of joint i.
        other: name of joint j.
        law: f, in rad or m of joint i.
    """

    joint: str
    other: str
    law: LawTable | Harmonic

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundMotionLawRow":
        return BoundMotionLawRow(model, data, self, at, name)


@dataclass(frozen=True)
class Sum(JointRow):
    """Row g = q_i - c_0 - c_1 q_j - c_2 q_k - ..., between joints of one coordinate each.

    Attributes:
        joints: names of joints i, j, k, ...
        coefficients: c_0, c_1, ..., as many as joints.
    """

    joints: tuple[str, ...]
    coefficients: tuple[float, ...]

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundSumRow":
        return BoundSumRow(model, data, self, at, name)


class BoundMotionLawRow(BoundCoordinateRow):
    """g = x_i - f(x_j) with a law f.

    Raises:
        InputError: for a law that is not periodic on an unbounded joint.
    """

    kind = "curved"

    def __init__(self, model: pin.Model, data: pin.Data, row: MotionLawRow, at: int, name: str) -> None:
        BoundJointRow.__init__(self, model, data, (row.joint, row.other), at, name)
        self.law, revolution, (_, length, increment) = row.law, 2 * np.pi, period_of(row.law)
        periods = [revolution] if self.joints[0].nq == 2 else []
        if self.joints[1].nq == 2:
            n = revolution / length if length else 0.0
            if not length or abs(n - round(n)) > COINCIDENT:
                what = "does not repeat itself in a revolution" if length else "is not periodic"
                raise InputError(f"{name!r}: a curve that {what} is not defined on an unbounded joint; bound the joint")
            periods += [abs(increment * round(n))] if increment else []
        self.period = common_period(periods, name)

    def core_data(self) -> CoreData:
        return {**super().core_data(), "law": self.law.core_data(), "fold": list(period_of(self.law))}

    def value(self) -> tuple[float, list[float]]:
        x, other = (coordinate(j.joint_q) for j in self._joint_data)
        f = law_derivatives(self.law, other)
        return x - f.y, [1.0, -f.first]

    def _curvature(self) -> tuple[float, float]:
        return law_derivatives(self.law, coordinate(self._joint_data[1].joint_q))[2:]


class BoundSumRow(BoundJointRow):
    """g = x_i - c_0 - c_1 x_j - c_2 x_k - ..., between three or more joints."""

    kind = "sum"

    def __init__(self, model: pin.Model, data: pin.Data, row: Sum, at: int, name: str) -> None:
        super().__init__(model, data, row.joints, at, name, row.coefficients)
        self.columns = [j.idx_v for j in self.joints]
        self.factors = [1.0, *(-c for c in row.coefficients[1:])]
        periods = [2 * np.pi * abs(c) for j, c in zip(self.joints, self.factors, strict=True) if j.nq == 2]
        self.period = common_period(periods, name)

    def value(self) -> tuple[float, list[float]]:
        x = [coordinate(j.joint_q) for j in self._joint_data]
        return float(np.dot(self.factors, x)) - self.polynomial[0], self.factors

    def bias(self, v: Array) -> float:
        return 0.0

    def partials(self, v: Array, lam: float, K: Array, B: Array) -> None:
        """G is constant."""

    def bias_partials(self, v: Array, by_q: Array, by_v: Array) -> None:
        """Gdot is zero."""
