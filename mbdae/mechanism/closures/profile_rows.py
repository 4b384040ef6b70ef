"""Contacts with a profile in the x-y plane of the first frame: rollers, pins in slots, flat faces.

    roller, pin    g = side (x - c).n - r at the nearest c, n the profile's normal in its plane;  along n through p_b
    flat face      g = n.(p_b - c), n the face's normal, c the profile's farthest point along it;  along n through c

A motion of the contact along the profile does not change g, so the rates are those of the lines.
"""

import numpy as np

from ...data_types import CoreData
from ...system import Array
from ..tree.frames import Pair
from .line_rows import LineRows, Lines, at_rest
from .profiles import PlaneCurve
from .rows import displaced, inner, rotated


class Roller(LineRows):
    """A roller about b's origin with a radius in m touches a profile of a; with radius 0 its origin stays on it."""

    m, positional = 1, True

    def __init__(self, path: PlaneCurve, radius: float) -> None:
        self.path, self.radius = path, radius

    def core_data(self) -> list[CoreData]:
        return [{"kind": "roller", "length": self.radius, "profile": self.path.core_data()}]

    def residual(self, pair: Pair) -> Array:
        x = pair.Ra.T.dot(pair.pb - pair.pa)[:2]
        c = self.path.nearest(x)
        n = np.array([c.d[1], -c.d[0]]) * (self.path.side / np.sqrt(c.d.dot(c.d)))
        return np.array([(x - c.c).dot(n) - self.radius])

    def lines(self, pair: Pair) -> Lines:
        pb, vb, Ra = pair.pb[:, None], displaced(pair.Vb, pair.pb), pair.Ra
        x = Ra.T.dot(pair.pb - pair.pa)[:2]
        rate = Ra.T.dot(vb - displaced(pair.Va, pair.pb))[:2, 0]
        _, c, d, dd = self.path.nearest(x)
        ds = rate.dot(d) / (d.dot(d) - (x - c).dot(dd))
        size = np.sqrt(d.dot(d))
        t = d / size
        dt = (dd - t * t.dot(dd)) * (ds / size)
        side = self.path.side
        e = Ra[:, :2].dot(side * np.array([[t[1]], [-t[0]]]))
        return Lines(e, pb, rotated(pair.Va, e) + Ra[:, :2].dot(side * np.array([[dt[1]], [-dt[0]]])), vb)


class FlatFace(LineRows):
    """A flat face of b through its origin touches a profile of a; its normal (3,) points away from the profile."""

    m, positional = 1, True

    def __init__(self, path: PlaneCurve, normal: Array) -> None:
        self.path, self.normal = path, normal[:, None]

    def core_data(self) -> list[CoreData]:
        return [{"kind": "flat_face", "b": self.normal[:, 0].tolist(), "profile": self.path.core_data()}]

    def residual(self, pair: Pair) -> Array:
        e, p = self.lines(at_rest(pair))[:2]
        return np.array([inner(e, pair.pb[:, None] - p)])

    def lines(self, pair: Pair) -> Lines:
        Ra, e = pair.Ra, pair.Rb.dot(self.normal)
        de = rotated(pair.Vb, e)
        n, dn = Ra.T.dot(e)[:2, 0], Ra.T.dot(de - rotated(pair.Va, e))[:2, 0]
        _, c, d, dd = self.path.support(n)
        ds = -d.dot(dn) / dd.dot(n)
        p = pair.pa[:, None] + Ra[:, :2].dot(c[:, None])
        return Lines(e, p, de, displaced(pair.Va, p[:, 0]) + Ra[:, :2].dot(d[:, None] * ds))
