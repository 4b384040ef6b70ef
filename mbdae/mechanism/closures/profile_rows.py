"""Contacts with a profile in the x-y plane of the first frame: rollers, pins in slots, flat faces.

    roller, pin    g = side (x - c).n - r at the nearest c, n the profile's normal in its plane;  along n through p_b
    flat face      g = n.(p_b - c), n the face's normal, c the profile's farthest point along it;  along n through c

g is stationary with respect to the contact's position on the profile, so G follows from the line alone.
"""

import numpy as np

from ...data_types import CoreData
from ...system import Array
from ..tree.frames import Pair
from .line_rows import LineRows, Lines, with_zero_velocity
from .profiles import PlaneCurve
from .rows import axis_rates, inner, point_velocity_column


class Roller(LineRows):
    """Row of a roller, about b's origin with a radius in m, in contact with a profile of a; radius 0 for a pin."""

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
        pb, vb, Ra = pair.pb[:, None], point_velocity_column(pair.Vb, pair.pb), pair.Ra
        x = Ra.T.dot(pair.pb - pair.pa)[:2]
        rate = Ra.T.dot(vb - point_velocity_column(pair.Va, pair.pb))[:2, 0]
        _, c, d, dd = self.path.nearest(x)
        ds = rate.dot(d) / (d.dot(d) - (x - c).dot(dd))
        size = np.sqrt(d.dot(d))
        t = d / size
        dt = (dd - t * t.dot(dd)) * (ds / size)
        side = self.path.side
        e = Ra[:, :2].dot(side * np.array([[t[1]], [-t[0]]]))
        return Lines(e, pb, axis_rates(pair.Va, e) + Ra[:, :2].dot(side * np.array([[dt[1]], [-dt[0]]])), vb)


class FlatFace(LineRows):
    """Row of a flat face through b's origin, in contact with a profile of a; its normal (3,) points away from it."""

    m, positional = 1, True

    def __init__(self, path: PlaneCurve, normal: Array) -> None:
        self.path, self.normal = path, normal[:, None]

    def core_data(self) -> list[CoreData]:
        return [{"kind": "flat_face", "b": self.normal[:, 0].tolist(), "profile": self.path.core_data()}]

    def residual(self, pair: Pair) -> Array:
        e, p = self.lines(with_zero_velocity(pair))[:2]
        return np.array([inner(e, pair.pb[:, None] - p)])

    def lines(self, pair: Pair) -> Lines:
        Ra, e = pair.Ra, pair.Rb.dot(self.normal)
        de = axis_rates(pair.Vb, e)
        n, dn = Ra.T.dot(e)[:2, 0], Ra.T.dot(de - axis_rates(pair.Va, e))[:2, 0]
        _, c, d, dd = self.path.support(n)
        ds = -d.dot(dn) / dd.dot(n)
        p = pair.pa[:, None] + Ra[:, :2].dot(c[:, None])
        return Lines(e, p, de, point_velocity_column(pair.Va, p[:, 0]) + Ra[:, :2].dot(d[:, None] * ds))
