"""Primitive rows between two frames that make up closures and drivers.

A row between two frames is a scalar g(q) whose rate is the power of a wrench w on frame b and -w on frame a,

    d/dt g = w . (V_b - V_a),   G_row = sign * (w^T J),   gamma = dw/dt . (V_b - V_a) + w . (A_b - A_a),

with spatial velocities V, accelerations A (for v' = 0) and wrenches about the world's origin. So a row needs only g, w
and dw/dt, and is exact off the manifold. A velocity row has w and no g (`mbdae.mechanism.closures.line_rows`).
Multipliers: N for rows measured in m, N m for products of axes. Rows between joint coordinates need no frames
(`mbdae.mechanism.closures.joint_rows`).

Names: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems (1989), section 9.4.
"""

from typing import ClassVar

import numpy as np

from ...data_types import CoreData
from ..tree.frames import Pair, cross, skew, unit_gap
from ..tree.wrench_partials import line_wrench_partials, moved_line_partials, skews

Vector = tuple[float, float, float]
AT_REST = np.zeros(6)  # velocity of bodies where only wrenches are needed, not their rates


class FrameRows:
    """m scalar rows between the anchors of a located `Pair`.

    Attributes:
        m: number of rows.
        unit: unit of g: ``"m"``, or ``"rad"`` for quantities that approximate a small angle.
        positional: whether there is a g; for velocity rows, which have none, the unit is that of G v times s.
    """

    m: int
    unit: ClassVar[str]
    positional: ClassVar[bool] = True

    def core_data(self) -> list[CoreData]:
        """Return the core data of each row, a kind and its parameters; empty if the core does not support it."""
        return []

    def residual(self, pair: Pair) -> np.ndarray:
        """Return g, (m,)."""
        raise NotImplementedError

    def wrenches(self, pair: Pair, w: np.ndarray) -> None:
        """Write the wrenches on b about the world's origin into w (6, m), which is initially zero."""
        raise NotImplementedError

    def rate(self, pair: Pair) -> np.ndarray:
        """Return dw/dt (6, m) for the velocities of the pair."""
        raise NotImplementedError

    def wrenches_and_rate(self, pair: Pair, w: np.ndarray) -> np.ndarray:
        """Write the wrenches into w, and return dw/dt, (6, m)."""
        self.wrenches(pair, w)
        return self.rate(pair)

    def partials(self, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
        """Return Da and Db, (m, 6, 6) each: dw = Da d_a + Db d_b for motions d (6,) of both anchors.

        If both anchors move together, so do the wrenches: (Da + Db) d = d x* w.
        """
        raise NotImplementedError

    def value(self, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
        """Return g (m,) and w (6, m)."""
        w = np.zeros((6, self.m))
        self.wrenches(pair, w)
        return self.residual(pair), w


class DotProduct1(FrameRows):
    """g = axis_a . axis_b, the cosine between axes fixed in a and in b; both (3, m)."""

    unit = "rad"

    def __init__(self, a: np.ndarray, b: np.ndarray) -> None:
        self.a, self.b, self.m = a, b, a.shape[1]

    def core_data(self) -> list[CoreData]:
        both = zip(self.a.T.tolist(), self.b.T.tolist(), strict=True)
        return [{"kind": "dot_product_1", "a": a, "b": b} for a, b in both]

    def residual(self, pair: Pair) -> np.ndarray:
        return (pair.Ra.dot(self.a) * pair.Rb.dot(self.b)).sum(axis=0)

    def wrenches(self, pair: Pair, w: np.ndarray) -> None:
        w[3:] = cross(pair.Rb.dot(self.b), pair.Ra.dot(self.a))

    def rate(self, pair: Pair) -> np.ndarray:
        a, b = pair.Ra.dot(self.a), pair.Rb.dot(self.b)
        da, db = axis_rates(pair.Va, a), axis_rates(pair.Vb, b)
        return np.concatenate([np.zeros_like(da), cross(db, a) + cross(b, da)])

    def partials(self, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
        a, b = skews(pair.Ra.dot(self.a)), skews(pair.Rb.dot(self.b))
        Da, Db = np.zeros((2, self.m, 6, 6))
        Da[:, 3:, 3:], Db[:, 3:, 3:] = -b @ a, a @ b
        return Da, Db


class DotProduct2(FrameRows):
    """g = axis_a . (p_b - p_a), the relative position along axes fixed in a; axes (3, m)."""

    unit = "m"

    def __init__(self, axes: np.ndarray) -> None:
        self.axes, self.m = axes, axes.shape[1]

    def core_data(self) -> list[CoreData]:
        return [{"kind": "dot_product_2", "a": a} for a in self.axes.T.tolist()]

    def residual(self, pair: Pair) -> np.ndarray:
        return (pair.pb - pair.pa).dot(pair.Ra.dot(self.axes))

    def wrenches(self, pair: Pair, w: np.ndarray) -> None:
        w[:3] = n = pair.Ra.dot(self.axes)
        w[3:] = skew(pair.pb).dot(n)

    def rate(self, pair: Pair) -> np.ndarray:
        n = pair.Ra.dot(self.axes)
        dn, dp = axis_rates(pair.Va, n), point_velocity(pair.Vb, pair.pb)
        return np.concatenate([dn, skew(dp).dot(n) + skew(pair.pb).dot(dn)])

    def partials(self, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
        n = pair.Ra.dot(self.axes)
        Da = np.zeros((self.m, 6, 6))
        Da[:, :3, 3:] = minus_n = -skews(n)
        Da[:, 3:, 3:] = skew(pair.pb) @ minus_n
        return Da, moved_line_partials(pair.pb, n)


class Distance(FrameRows):
    """g = |p_b - p_a| - length."""

    m, unit = 1, "m"

    def __init__(self, length: float) -> None:
        self.length = length

    def core_data(self) -> list[CoreData]:
        return [{"kind": "distance", "length": self.length}]

    def residual(self, pair: Pair) -> np.ndarray:
        return np.array([unit_gap(pair)[0] - self.length])

    def wrenches(self, pair: Pair, w: np.ndarray) -> None:
        w[:3, 0] = n = unit_gap(pair)[1]
        w[3:, 0] = skew(pair.pb).dot(n)

    def rate(self, pair: Pair) -> np.ndarray:
        distance, n = unit_gap(pair)
        dpb = point_velocity(pair.Vb, pair.pb)
        dd = dpb - point_velocity(pair.Va, pair.pa)
        dn = (dd - n * n.dot(dd)) / distance
        return np.concatenate([dn, skew(dpb).dot(n) + skew(pair.pb).dot(dn)])[:, None]

    def partials(self, pair: Pair) -> tuple[np.ndarray, np.ndarray]:
        _, Da, Db = line_wrench_partials(pair)
        return Da[None], Db[None]


def inner(a: np.ndarray, b: np.ndarray) -> float:
    """Return a . b of two columns (3, 1), real or complex; (a * b).sum() takes three times as long."""
    return a.ravel().dot(b.ravel())


def axis_rates(V: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return the rates omega x n of axes n (3, m) fixed in a body with spatial velocity V (6,)."""
    return np.zeros(n.shape) if V is AT_REST else skew(V[3:]).dot(n)


def point_velocity(V: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the velocity (3,) of a point p (3,) of a body with spatial velocity V (6,)."""
    return V[:3] + axis_rates(V, p)


def point_velocity_column(V: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the velocity of a point as a column (3, 1), see `point_velocity`."""
    return point_velocity(V, p)[:, None]


def unit_axis(axis: Vector) -> np.ndarray:
    """Return an axis of length 1."""
    return np.array(axis) / np.linalg.norm(axis)
