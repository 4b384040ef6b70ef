"""Rows along lines through a point, along which the velocities of two bodies at the point have equal components.

    0 = w . (V_b - V_a),   w = [e; p x e],   w' = [e'; p' x e + p x e']

with unit vectors e through a point p: a force along e. Each kind computes e, p and their rates for the velocities of
both frames. Velocity rows have no g, and therefore no drift-off. Rates are linear in the velocities, which yields the
partial derivatives of w: w' = Da V_a + Db V_b.

Source: J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems (1972), chapter 3.
"""

from typing import NamedTuple

import numpy as np

from ...system import Array
from ..tree.frames import Pair, cross, wrench_matrix
from .rows import AT_REST, FrameRows, inner


class Lines(NamedTuple):
    """Lines and their rates.

    Attributes:
        e: directions, (3, m).
        p: their common point in m, (3, 1).
        de: rates of e, (3, m).
        dp: rate of p in m/s, (3, 1).
    """

    e: Array
    p: Array
    de: Array
    dp: Array


class LineRows(FrameRows):
    """Rows along m lines through one point.

    Attributes:
        advance: translation along the line per radian of relative rotation about it, in m/rad:
            w = [e; p x e - advance e].
    """

    unit = "m"
    positional = False
    advance = 0.0

    def lines(self, pair: Pair) -> Lines:
        """Return the lines at the current pair, and their rates for its velocities Va, Vb."""
        raise NotImplementedError

    def residual(self, pair: Pair) -> Array:
        return np.zeros(self.m)

    def wrenches(self, pair: Pair, w: Array) -> None:
        self._write(self.lines(with_zero_velocity(pair)), w)

    def rate(self, pair: Pair) -> Array:
        return self._rate(self.lines(pair))

    def wrenches_and_rate(self, pair: Pair, w: Array) -> Array:
        lines = self.lines(pair)  # evaluated once for both
        self._write(lines, w)
        return self._rate(lines)

    def _write(self, lines: Lines, w: Array) -> None:
        e = lines.e
        w[:3], w[3:] = e, cross(lines.p, e) - self.advance * e

    def _rate(self, lines: Lines) -> Array:
        e, p, de, dp = lines
        return np.concatenate([de, cross(dp, e) + cross(p, de) - self.advance * de])

    def partials(self, pair: Pair) -> tuple[Array, Array]:
        Db, w, moving = np.empty((self.m, 6, 6)), np.zeros((6, self.m)), with_zero_velocity(pair)
        for i, motion in enumerate(np.eye(6)):
            moving.Vb = motion
            Db[:, :, i] = self.wrenches_and_rate(moving, w).T
        return np.array([wrench_matrix(x) for x in w.T]) - Db, Db  # a common rigid motion of both frames moves w, too


def with_zero_velocity(pair: Pair) -> Pair:
    """Return a pair with the same poses and zero velocities."""
    out = Pair.__new__(Pair)  # faster than a copy
    vars(out).update(vars(pair), Va=AT_REST, Vb=AT_REST)
    return out


def unit(x: Array, dx: Array) -> tuple[Array, Array]:
    """Return x/|x| and its rate, for a column x (3, 1) and its rate; supports complex steps."""
    size = np.sqrt(inner(x, x))
    e = x / size
    return e, (dx - e * inner(e, dx)) / size
