"""Contact kinematics of a convex body of b that rolls on a surface of a.

n is the surface's normal towards b and p the lowest point of the body, p_b - R_b grad h(R_b^T n), where h(n) is the
support function of the body in the direction -n. The gap is g = n . (p - p_a); its row is along n, since n . x is
stationary over the points x of the body's surface at the lowest point. No-slip rows are along tangents. With the axle s
of a wheel and n up, t = s x n/|s x n| points forwards and n x t to the left.

    wheel        h = tyre + rim |m|, m = n - (n . s) s, u = m/|m|:   p = p_b - rim u - tyre n
    ellipsoid    h = sqrt(n . D n) - c . n, D = diag(a_i^2):         p = p_b + c - D n/sqrt(n . D n)

Source: A. Bloch, Nonholonomic Mechanics and Control (2003), section 1.4; Meijaard, Papadopoulos, Ruina, Schwab,
Proc. R. Soc. A 463 (2007) for wheels.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...data_types import CoreData
from ...errors import StepError
from ...system import Array
from ...tolerances import PARALLEL, ROUNDING
from ..tree.frames import Pair, cross
from .line_rows import LineRows, Lines, unit, with_zero_velocity
from .rows import axis_rates, inner, point_velocity_column


class ContactKinematics(NamedTuple):
    """Normal of the surface and contact point on the body, and their rates; columns (3, 1)."""

    n: Array
    p: Array
    dn: Array
    dp: Array


@dataclass(frozen=True)
class ConvexBody:
    """Convex body, in the second frame, on a surface of a, in the first frame.

    Attributes:
        axle: unit vector along the axle of a wheel, (3,); None for a sphere or an ellipsoid, which has no heading.
        rim: radius of the circle of tyre section centres, in m; 0 for a sphere.
        tyre: radius of the tyre's section in m; 0 for a knife edge.
        semi_axes: semi-axes of an ellipsoid in m, (3,); None for a wheel or sphere.
        centre: centre of an ellipsoid in m, (3,).
        surface: ``"plane"`` with normal z, ``"sphere"`` or ``"cylinder"`` about z.
        surface_radius: radius of a sphere or cylinder in m, negative where the body rolls inside.
    """

    axle: tuple[float, float, float] | None
    rim: float
    tyre: float
    semi_axes: tuple[float, float, float] | None
    centre: tuple[float, float, float]
    surface: str
    surface_radius: float

    def core_data(self) -> CoreData:
        """Return the core data of the shape."""
        zero = (0.0, 0.0, 0.0)
        return {
            "rim": self.rim,
            "tyre": self.tyre,
            "curve": self.surface_radius,
            "parallel": PARALLEL,
            "axle": list(self.axle or zero),
            "squares": [a * a for a in self.semi_axes or zero],
            "centre": list(self.centre),
            "body": "ellipsoid" if self.semi_axes else "wheel" if self.axle else "sphere",
            "surface": self.surface,
        }

    def contact_kinematics(self, pair: Pair) -> ContactKinematics:
        """Return normal and contact point, and their rates for the velocities of the pair."""
        n, dn = self.normal(pair)
        pb, vb = pair.pb[:, None], point_velocity_column(pair.Vb, pair.pb)
        if self.semi_axes:
            R, w = pair.Rb, pair.Vb
            D = (R * np.square(self.semi_axes)).dot(R.T)
            c = R.dot(np.array(self.centre)[:, None])
            Dn = D.dot(n)
            dn_relative = dn - axis_rates(w, n)
            size = np.sqrt(inner(n, Dn))
            dDn = axis_rates(w, Dn) + D.dot(dn_relative)
            grad = Dn / size
            dgrad = (dDn - grad * inner(grad, dn_relative)) / size
            return ContactKinematics(n, pb + c - grad, dn, vb + axis_rates(w, c) - dgrad)
        p, dp = pb - self.tyre * n, vb - self.tyre * dn
        if self.rim and self.axle:
            s = self.axis(pair)
            ds, along = axis_rates(pair.Vb, s), inner(n, s)
            m = n - along * s
            _require_not_flat(m)
            u, du = unit(m, dn - (inner(dn, s) + inner(n, ds)) * s - along * ds)
            p, dp = p - self.rim * u, dp - self.rim * du
        return ContactKinematics(n, p, dn, dp)

    def normal(self, pair: Pair) -> tuple[Array, Array]:
        """Return the surface's normal and its rate."""
        z = pair.Ra[:, 2:]
        dz = axis_rates(pair.Va, z)
        if self.surface == "plane":
            return z, dz
        d, dd = _offset(pair)
        if self.surface == "cylinder":
            along = inner(z, d)
            d, dd = d - along * z, dd - along * dz - (inner(dz, d) + inner(z, dd)) * z
        if not inner(d, d):
            where = "at the centre of its sphere" if self.surface == "sphere" else "on the axis of its cylinder"
            raise StepError("singular", f"the centre of a rolling body is {where}: the surface has no normal there")
        n, dn = unit(d, dd)
        return (n, dn) if self.surface_radius > 0 else (-n, -dn)

    def height(self, pair: Pair) -> float:
        """Return the gap in m."""
        contact = self.contact_kinematics(with_zero_velocity(pair))
        height = float(inner(contact.n, contact.p - pair.pa[:, None]))
        return height if self.surface == "plane" else height - self.surface_radius

    def axis(self, pair: Pair) -> Array:
        """Return the axle in the world, (3, 1)."""
        return pair.Rb.dot(np.array(self.axle)[:, None])

    def heading(self, pair: Pair, n: Array, dn: Array) -> tuple[Array, Array]:
        """Return a tangent and its rate: forwards for a wheel; otherwise x of a on a plane, or around z on a cylinder.

        On a sphere it is x of a, reflected in the plane that maps z of a to -n. It varies continuously, except at
        n = -z, as required for slip directions, which are stored as components along the tangents.
        """
        if self.axle:
            s = self.axis(pair)
            forward, rate = cross_with_rate(s, axis_rates(pair.Vb, s), n, dn)
            _require_not_flat(forward)
            return unit(forward, rate)
        x, z = pair.Ra[:, :1], pair.Ra[:, 2:]
        if self.surface == "plane":
            return x, axis_rates(pair.Va, x)
        dx, dz = axis_rates(pair.Va, x), axis_rates(pair.Va, z)
        if self.surface == "cylinder":
            return unit(*cross_with_rate(z, dz, n, dn))
        w = n + z
        if not np.sqrt(inner(w, w)).real > PARALLEL:
            return unit(*cross_with_rate(x, dx, n, dn))
        u, du = unit(w, dn + dz)
        along, change = inner(u, x), inner(du, x) + inner(u, dx)
        return x - 2.0 * along * u, dx - 2.0 * (change * u + along * du)


class ContactHeightRow(LineRows):
    """g = n . (p - p_a): the lowest point of a body stays on a surface; a positive multiplier is compression."""

    m, positional = 1, True

    def __init__(self, shape: ConvexBody) -> None:
        self.shape = shape

    def core_data(self) -> list[CoreData]:
        return [{"kind": "height", "shape": self.shape.core_data()}]

    def residual(self, pair: Pair) -> Array:
        return np.array([self.shape.height(pair)])

    def lines(self, pair: Pair) -> Lines:
        n, p, dn, dp = self.shape.contact_kinematics(pair)
        return Lines(n, p, dn, dp)


class NoSlipRows(LineRows):
    """No slip at the lowest point along tangents at angles (m,) in rad from the heading to the left."""

    def __init__(self, shape: ConvexBody, angles: tuple[float, ...]) -> None:
        self.shape, self.m = shape, len(angles)
        self.directions = np.array([np.cos(angles), np.sin(angles)])  # components forwards and to the left, (2, m)
        self.directions[np.abs(self.directions) < ROUNDING] = 0.0

    def core_data(self) -> list[CoreData]:
        shape = self.shape.core_data()
        return [{"kind": "grip", "shape": shape, "direction": x.tolist()} for x in self.directions.T]

    def lines(self, pair: Pair) -> Lines:
        n, p, dn, dp = self.shape.contact_kinematics(pair)
        t, dt = self.shape.heading(pair, n, dn)
        forward, left = self.directions[:1], self.directions[1:]
        s, ds = cross_with_rate(n, dn, t, dt)
        return Lines(t.dot(forward) + s.dot(left), p, dt.dot(forward) + ds.dot(left), dp)


def cross_with_rate(a: Array, da: Array, b: Array, db: Array) -> tuple[Array, Array]:
    """Return a x b and its rate a' x b + a x b', for columns (3, 1)."""
    x = cross(np.concatenate((a, da, a), axis=1), np.concatenate((b, b, db), axis=1))
    return x[:, :1], x[:, 1:2] + x[:, 2:]


def _offset(pair: Pair) -> tuple[Array, Array]:
    """Return p_b - p_a and its rate, (3, 1) each."""
    velocity = point_velocity_column(pair.Vb, pair.pb) - point_velocity_column(pair.Va, pair.pa)
    return (pair.pb - pair.pa)[:, None], velocity


def _require_not_flat(x: Array) -> None:
    if not np.sqrt(inner(x, x)).real > PARALLEL:
        raise StepError("singular", "the wheel lies flat: it has no lowest point")
