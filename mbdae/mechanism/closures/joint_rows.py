"""Rows between joints of one coordinate each, described and bound to a workspace.

The multiplier of a row is the torque (N m) or force (N) on the first joint.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import atan2, gcd, lcm
from typing import ClassVar

import numpy as np
import pinocchio as pin

from ...data_types import CoreData
from ...errors import InputError
from ...system import Array
from ...tolerances import SOLUTION_ROUNDING
from ..tree.frames import find_joint
from ..tree.joints import subspace

MAX_DENOMINATOR = 1000  # largest denominator of a rational ratio of unbounded joints


class JointRow:
    """A description of one row between joints.

    Attributes:
        m: number of rows: 1.
        positional: whether it has a g.
    """

    m: ClassVar[int] = 1
    positional: bool = True

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundJointRow":
        """Bind the row, with index ``at`` among all rows, to a workspace; the closure's name is for messages."""
        raise NotImplementedError


@dataclass(frozen=True)
class Coordinate(JointRow):
    """Row g = q_i - c_0 - c_1 q_j - c_2 q_j^2 - ..., between joints of one coordinate each, in rad or m of joint i.

    Attributes:
        joint: name of joint i.
        other: name of joint j; without one the row is g = q_i - c_0.
        coefficients: c_0, c_1, ... in rad or m per power of the other coordinate.
    """

    joint: str
    other: str
    coefficients: tuple[float, ...]

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundCoordinateRow":
        return BoundCoordinateRow(model, data, self, at, name)


@dataclass(frozen=True)
class Ratio(JointRow):
    """Velocity row v_i = r(q_k) v_j, r = c_0 + c_1 q_k + c_2 q_k^2 + ..., between joints of one coordinate each.

    Attributes:
        joint: name of joint i.
        other: name of joint j; without one the row is v_i = 0.
        setting: name of joint k; without one r = c_0.
        coefficients: c_0, c_1, ...
    """

    joint: str
    other: str
    setting: str
    coefficients: tuple[float, ...]
    positional = False

    def bind(self, model: pin.Model, data: pin.Data, at: int, name: str) -> "BoundRatioRow":
        return BoundRatioRow(model, data, self, at, name)


class BoundJointRow:
    """One row between joints.

    Attributes:
        at: index of the row.
        joints: joints of Pinocchio's model, (k,).
        columns: velocity indices of the connected joints, (1,) or (2,).
        polynomial: c_0, c_1, ...
        period: period up to multiples of which g is known; 0 if g is unique.

    Raises:
        InputError: for joints of several coordinates.
    """

    kind = ""
    period = 0.0

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        names: Sequence[str],
        at: int,
        name: str,
        polynomial: tuple[float, ...] = (),
    ) -> None:
        self.at, self.polynomial = at, polynomial
        known = [n for n in names if n]
        self.joints = [find_joint(model, n) for n in known]
        for j, n in zip(self.joints, known, strict=True):
            if j.nv != 1:
                raise InputError(f"{name!r} needs joints of one coordinate; joint {n!r} has nv = {j.nv}")
        self.columns = [j.idx_v for j in self.joints[:2]]
        self._joint_data = [data.joints[j.id] for j in self.joints]

    @property
    def unit(self) -> str:
        """Unit of g: ``"rad"``, or ``"m"`` where the first joint slides."""
        return "rad" if subspace(self.joints[0])[3:].any() else "m"

    def core_data(self) -> CoreData:
        """Return the core data of the row."""
        joints = [{"iq": j.idx_q, "nq": j.nq, "iv": j.idx_v} for j in self.joints]
        return {"kind": self.kind, "joints": joints, "c": list(self.polynomial), "period": self.period}

    def value(self) -> tuple[float, list[float]]:
        """Return g, 0 for a velocity row, and the entries of G in the columns."""
        raise NotImplementedError

    def bias(self, v: Array) -> float:
        """Return Gdot v."""
        raise NotImplementedError

    def partials(self, v: Array, lam: float, K: Array, B: Array) -> None:
        """Add d(G^T lam)/dq to K (nv, nv) and d(G v)/dq to B (nv,)."""
        raise NotImplementedError

    def bias_partials(self, v: Array, by_q: Array, by_v: Array) -> None:
        """Add the partial derivatives of Gdot v to by_q and by_v, (nv,) each."""
        raise NotImplementedError


class BoundCoordinateRow(BoundJointRow):
    """g = x_i - p(x_j), with x an angle in (-pi, pi] for an unbounded joint.

    Raises:
        InputError: for a coupling that is undefined on unbounded joints.
    """

    kind = "coordinate"

    def __init__(self, model: pin.Model, data: pin.Data, row: Coordinate, at: int, name: str) -> None:
        super().__init__(model, data, (row.joint, row.other), at, name, row.coefficients)
        self.period = _period([j.nq == 2 for j in self.joints], row.coefficients, name)

    def value(self) -> tuple[float, list[float]]:
        x, *other = (coordinate(j.joint_q) for j in self._joint_data)
        if not other:
            return x - sum(self.polynomial), [1.0]
        p, first, *_ = _horner(self.polynomial, other[0])
        return x - p, [1.0, -first]

    def bias(self, v: Array) -> float:
        return -self._curvature()[0] * float(v[self.columns[-1]]) ** 2

    def partials(self, v: Array, lam: float, K: Array, B: Array) -> None:
        j, second = self.columns[-1], self._curvature()[0]
        K[j, j] -= lam * second
        B[j] -= second * v[j]

    def bias_partials(self, v: Array, by_q: Array, by_v: Array) -> None:
        j, (second, third) = self.columns[-1], self._curvature()
        by_q[j] -= third * v[j] ** 2
        by_v[j] -= 2 * second * v[j]

    def _curvature(self) -> tuple[float, float]:
        """Return the second and the third derivative of p at x_j; zero without joint j."""
        if len(self._joint_data) == 1:
            return 0.0, 0.0
        return _horner(self.polynomial, coordinate(self._joint_data[1].joint_q))[2:]


class BoundRatioRow(BoundJointRow):
    """0 = v_i - r(x_k) v_j, r a polynomial.

    Raises:
        InputError: for a ratio that depends on an unbounded joint.
    """

    kind = "ratio"

    def __init__(self, model: pin.Model, data: pin.Data, row: Ratio, at: int, name: str) -> None:
        super().__init__(model, data, (row.joint, row.other, row.setting), at, name, row.coefficients)
        self.settings = [j.idx_v for j in self.joints[2:]]
        if self.settings and self.joints[2].nq > 1:
            what = f"powers of an unbounded joint's angle are not defined; bound joint {row.setting!r}"
            raise InputError(f"{name!r}: {what}")

    def value(self) -> tuple[float, list[float]]:
        return 0.0, [1.0, -self._ratio()[0]][: len(self.columns)]

    def bias(self, v: Array) -> float:
        return -sum(float(self._ratio()[1] * v[self.columns[1]] * v[k]) for k in self.settings)

    def partials(self, v: Array, lam: float, K: Array, B: Array) -> None:
        for k in self.settings:
            j = self.columns[1]
            K[j, k] -= lam * self._ratio()[1]
            B[k] -= self._ratio()[1] * v[j]

    def bias_partials(self, v: Array, by_q: Array, by_v: Array) -> None:
        for k in self.settings:
            j = self.columns[1]
            _, first, second, _ = self._ratio()
            by_q[k] -= second * v[k] * v[j]
            by_v[j] -= first * v[k]
            by_v[k] -= first * v[j]

    def _ratio(self) -> tuple[float, float, float, float]:
        """Return the ratio and its first three derivatives; a constant without joint k."""
        return _horner(self.polynomial, coordinate(self._joint_data[2].joint_q) if len(self._joint_data) > 2 else 0.0)


def coordinate(q: Array) -> float:
    """Return the coordinate of a joint from its components of q: an angle in (-pi, pi] if it is unbounded."""
    return float(q[0]) if len(q) == 1 else atan2(q[1], q[0])


def _horner(coefficients: Sequence[float], x: float) -> tuple[float, float, float, float]:
    """Return a polynomial and its first three derivatives at x."""
    p = first = second = third = 0.0
    for c in reversed(coefficients):
        p, first, second, third = p * x + c, first * x + p, second * x + 2 * first, third * x + 3 * second
    return p, first, second, third


def _period(unbounded: list[bool], coefficients: Sequence[float], name: str) -> float:
    """Return the period of q_i - p(q_j) if q_i, q_j or both are known up to full revolutions."""
    revolution = 2 * np.pi
    if len(unbounded) == 1 or not unbounded[1]:
        return revolution if unbounded[0] else 0.0
    if any(coefficients[2:]):
        raise InputError(f"{name!r}: powers of an unbounded joint's angle are not defined; bound the joint")
    return common_period([revolution * abs(coefficients[1])] + ([revolution] if unbounded[0] else []), name)


def common_period(periods: Sequence[float], name: str) -> float:
    """Return the greatest common divisor of some periods, 0 if there are none: the period of a sum of angles."""
    periods = [p for p in periods if p]
    if not periods:
        return 0.0
    last = periods[-1]
    ratios = [Fraction(p / last).limit_denominator(MAX_DENOMINATOR) for p in periods]
    for period, ratio in zip(periods, ratios, strict=True):
        if abs(float(ratio) * last - period) > SOLUTION_ROUNDING * period:
            raise InputError(
                f"{name!r}: the ratio {period / last!r} of two unbounded joints is not a fraction with a denominator "
                f"up to {MAX_DENOMINATOR}: the angles do not determine the error of the coupling; bound one joint"
            )
    denominator = lcm(*(r.denominator for r in ratios))
    return last * gcd(*(int(r * denominator) for r in ratios)) / denominator
