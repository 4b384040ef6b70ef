"""A row between coordinates of joints, bound to a workspace."""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array
from ..frames import find_joint
from ..joints import subspace
from .rows import Coordinate

LARGEST_DENOMINATOR = 1000


class JointPart:
    """One row between joint coordinates: g = x_i - p(x_j), with x an angle in (-pi, pi] for an unbounded joint.

    Attributes:
        at: number of the row.
        joints: of Pinocchio's model, (1,) or (2,).
        columns: velocity indices of the joints, (1,) or (2,).
        period: g is known up to multiples of it; 0 where it is known outright.

    Raises:
        InputError: for joints of several coordinates, or a coupling that is not defined on unbounded joints.
    """

    def __init__(self, model: pin.Model, data: pin.Data, row: Coordinate, at: int, name: str) -> None:
        self.at, self.polynomial = at, row.coefficients
        names = [row.joint, row.other] if row.other else [row.joint]
        self.joints = [find_joint(model, n) for n in names]
        for j, n in zip(self.joints, names, strict=True):
            if j.nv != 1:
                raise InputError(f"{name!r} needs joints of one coordinate; joint {n!r} has nv = {j.nv}")
        self.columns = [j.idx_v for j in self.joints]
        self._live = [data.joints[j.id] for j in self.joints]
        self.period = _period([j.nq == 2 for j in self.joints], row.coefficients, name)

    @property
    def unit(self) -> str:
        """Unit of g: ``"rad"``, or ``"m"`` where the first joint slides."""
        return "rad" if subspace(self.joints[0])[3:].any() else "m"

    def plain(self) -> dict[str, Any]:
        """Return what the compiled core is told of the row."""
        joints = [[j.idx_q, j.nq, j.idx_v] for j in self.joints]
        return {"kind": "coordinate", "joints": joints, "c": list(self.polynomial), "period": self.period}

    def value(self) -> tuple[float, list[float]]:
        """Return g and the entries of G in the columns."""
        x, *other = (_coordinate(j.joint_q) for j in self._live)
        if not other:
            return x - sum(self.polynomial), [1.0]
        p, slope, *_ = _horner(self.polynomial, other[0])
        return x - p, [1.0, -slope]

    def bias(self, v: Array) -> float:
        """Return Gdot v = -p'' x_j'^2."""
        return -self.curvature()[0] * float(v[self.columns[-1]]) ** 2

    def curvature(self) -> tuple[float, float]:
        """Return the second and the third derivative of p at x_j; zero without joint j."""
        if len(self._live) == 1:
            return 0.0, 0.0
        return _horner(self.polynomial, _coordinate(self._live[1].joint_q))[2:]


def _coordinate(q: Array) -> float:
    return float(q[0]) if len(q) == 1 else float(np.arctan2(q[1], q[0]))


def _horner(coefficients: Sequence[float], x: float) -> tuple[float, float, float, float]:
    """A polynomial and its first three derivatives at x."""
    p = slope = curve = third = 0.0
    for c in reversed(coefficients):
        p, slope, curve, third = p * x + c, slope * x + p, curve * x + 2 * slope, third * x + 3 * curve
    return p, slope, curve, third


def _period(unbounded: list[bool], coefficients: Sequence[float], name: str) -> float:
    """The number up to whose multiples q_i - p(q_j) is known where q_i, q_j or both are known up to full turns."""
    turn = 2 * np.pi
    if len(unbounded) == 1 or not unbounded[1]:
        return turn if unbounded[0] else 0.0
    ratio = coefficients[1]
    if any(coefficients[2:]):
        raise InputError(f"{name!r}: powers of an unbounded joint's angle are not defined; bound the joint")
    if not unbounded[0]:
        return turn * abs(ratio)
    fraction = Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR)
    if abs(float(fraction) - ratio) > 1e-12 * abs(ratio):
        raise InputError(
            f"{name!r}: the ratio {ratio!r} of two unbounded joints is no fraction with a denominator up to "
            f"{LARGEST_DENOMINATOR}: the angles do not tell how far it is kept; bound one joint"
        )
    return turn / fraction.denominator
