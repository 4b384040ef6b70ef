"""Velocity rows: the velocities of two bodies at a point are equal along lines through it.

    0 = w . (V_b - V_a) + ...,   w = [e; p x e],   w' = [e'; p' x e + p x e']

with unit vectors e through a point p: a force along e. Each kind computes e, p and their rates for the motions of both
frames; there is no drift-off, since there is no g. Rates are linear in the motions, which yields the partial
derivatives of w: w' = Da V_a + Db V_b.

Source: J. I. Neimark, N. A. Fufaev, Dynamics of Nonholonomic Systems (1972), chapter 3.
"""

from copy import copy
from typing import Any, NamedTuple

import numpy as np

from ...errors import StepError
from ...system import Array
from ..frames import Pair, cross
from .rows import FrameRows, displaced, rotated

PARALLEL = 1e-6  # rad between axes of a bevel pair, which have no common point


class Lines(NamedTuple):
    """Lines and their rates.

    Attributes:
        e: directions, (3, m).
        p: a point of all of them in m, (3, 1).
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
        lead: coefficient of the relative rotation about the line, in m/rad: w = [e; p x e - lead e].
    """

    unit = "m"
    positional = False
    lead = 0.0

    def lines(self, pair: Pair) -> Lines:
        """Return the lines at the current pair, and their rates for its velocities Va, Vb."""
        raise NotImplementedError

    def residual(self, pair: Pair) -> Array:  # noqa: D102
        return np.zeros(self.m)

    def wrenches(self, pair: Pair, w: Array) -> None:  # noqa: D102
        e, p = self.lines(at_rest(pair))[:2]
        w[:3], w[3:] = e, cross(p, e) - self.lead * e

    def rate(self, pair: Pair) -> Array:  # noqa: D102
        e, p, de, dp = self.lines(pair)
        return np.concatenate([de, cross(dp, e) + cross(p, de) - self.lead * de])

    def partials(self, pair: Pair) -> tuple[Array, Array]:  # noqa: D102
        Da, Db = np.empty((2, self.m, 6, 6))
        at = at_rest(pair)
        for i, unit in enumerate(np.eye(6)):
            at.Va, at.Vb = unit, at.zero
            Da[:, :, i] = self.rate(at).T
            at.Va, at.Vb = at.zero, unit
            Db[:, :, i] = self.rate(at).T
        return Da, Db


def at_rest(pair: Pair) -> Any:
    """Return a pair at the same position, at rest."""
    at: Any = copy(pair)
    at.Va = at.Vb = at.zero = np.zeros(6)
    return at


class KnifeEdge(LineRows):
    """No slip of b's origin against a along an axis of b, (3,)."""

    m = 1

    def __init__(self, axis: Array) -> None:
        self.axis = axis[:, None]

    def core_data(self) -> list[dict[str, Any]]:  # noqa: D102
        return [{"kind": "knife_edge", "b": self.axis[:, 0].tolist()}]

    def lines(self, pair: Pair) -> Lines:  # noqa: D102
        e = pair.Rb.dot(self.axis)
        return Lines(e, pair.pb[:, None], rotated(pair.Vb, e), displaced(pair.Vb, pair.pb))


class Screw(LineRows):
    """b advances along an axis of a, (3,), by ``lead`` in m per radian of its turn about it."""

    m = 1

    def __init__(self, axis: Array, lead: float) -> None:
        self.axis, self.lead = axis[:, None], lead

    def core_data(self) -> list[dict[str, Any]]:  # noqa: D102
        return [{"kind": "screw", "a": self.axis[:, 0].tolist(), "length": self.lead}]

    def lines(self, pair: Pair) -> Lines:  # noqa: D102
        e = pair.Ra.dot(self.axis)
        return Lines(e, pair.pb[:, None], rotated(pair.Va, e), displaced(pair.Vb, pair.pb))


class Gear(LineRows):
    """Wheels of a and b about parallel axes, an axis of a (3,), do not slip at the pitch point.

    It divides the line of centres in proportion to the radii: p = p_a + share (p_b - p_a), share = r_a/(r_a + r_b); the
    row is along e = k x (p_b - p_a)/|.|.
    """

    m = 1

    def __init__(self, axis: Array, share: float) -> None:
        self.axis, self.share = axis[:, None], share

    def core_data(self) -> list[dict[str, Any]]:  # noqa: D102
        return [{"kind": "gear", "a": self.axis[:, 0].tolist(), "length": self.share}]

    def lines(self, pair: Pair) -> Lines:  # noqa: D102
        pa, va = pair.pa[:, None], displaced(pair.Va, pair.pa)
        d, dd = pair.pb[:, None] - pa, displaced(pair.Vb, pair.pb) - va
        k = pair.Ra.dot(self.axis)
        if not (along := cross(k, d)).any():
            raise StepError("singular", "its wheels have one axis: they have no line of centres")
        e, de = unit(along, cross(rotated(pair.Va, k), d) + cross(k, dd))
        return Lines(e, pa + self.share * d, de, va + self.share * dd)


class Bevel(LineRows):
    """Wheels of a and b about axes that meet, an axis of each (3,), do not slip on each other.

    The row is along e = k_a x k_b/|.|, perpendicular to both axes, through the point of the pitch cones' common line at
    distances r_a and r_b from them: (p - p_a) . (e x k_a) = r_a, (p - p_b) . (k_b x e) = r_b. Hence r_a w_a + r_b w_b =
    0 relative to the carrier of both axes, wherever on these axes the frames are, and the multiplier is the tangential
    force in N.
    """

    m = 1

    def __init__(self, a: Array, b: Array, radii: tuple[float, float]) -> None:
        self.a, self.b, self.radii = a[:, None], b[:, None], radii

    def core_data(self) -> list[dict[str, Any]]:  # noqa: D102
        a, b = self.a[:, 0].tolist(), self.b[:, 0].tolist()
        return [{"kind": "bevel", "a": a, "b": b, "length": self.radii[0], "other_length": self.radii[1]}]

    def lines(self, pair: Pair) -> Lines:  # noqa: D102
        ka, kb = pair.Ra.dot(self.a), pair.Rb.dot(self.b)
        dka, dkb = rotated(pair.Va, ka), rotated(pair.Vb, kb)
        across = cross(ka, kb)
        if not np.sqrt((across * across).sum()).real > PARALLEL:
            raise StepError("singular", "its axes are parallel: kind 'gear' is for those")
        e, de = unit(across, cross(dka, kb) + cross(ka, dkb))
        n = np.hstack([cross(e, ka), cross(kb, e), e])
        dn = np.hstack([cross(de, ka) + cross(e, dka), cross(dkb, e) + cross(kb, de), de])
        at, va = np.column_stack([pair.pa, pair.pb, pair.pa]), displaced(pair.Va, pair.pa)
        speed = np.hstack([va, displaced(pair.Vb, pair.pb), va])
        p = np.linalg.solve(n.T, (n * at).sum(axis=0) + np.array([*self.radii, 0.0]))
        dp = np.linalg.solve(n.T, (dn * (at - p[:, None]) + n * speed).sum(axis=0))
        return Lines(e, p[:, None], de, dp[:, None])


def unit(x: Array, dx: Array) -> tuple[Array, Array]:
    """Return x/|x| and its rate, for a column x (3, 1) and its rate; supports complex steps."""
    size = np.sqrt((x * x).sum())
    e = x / size
    return e, (dx - e * (e * dx).sum()) / size
