"""The car axis problem from the test set for initial value problem solvers, at velocity level."""

from math import cos as cosine
from math import hypot, sin, sqrt

import numpy as np

from ...system import Array
from ..hessenberg import Hessenberg

__all__ = ["car_axis_equations"]

EPS, MASS, LENGTH, REST, HEIGHT, OMEGA, GRAVITY = 1e-2, 10.0, 1.0, 0.5, 0.1, 10.0, 1.0
K = MASS * EPS**2 / 2  # point mass divided by the stiffness of its spring


def road(t: float) -> tuple[float, float, float, float, float, float]:
    """Return x, y of the right wheel, at one axle length from the left wheel at the origin, and x', y', x'', y''."""
    y, dy = HEIGHT * sin(OMEGA * t), HEIGHT * OMEGA * cosine(OMEGA * t)
    x, ddy = sqrt(LENGTH**2 - y * y), -(OMEGA**2) * y
    dx = -y * dy / x
    return x, y, dx, dy, -(dy * dy + y * ddy + dx * dx) / x, ddy


def jacobian(t: float, y: Array) -> Array:
    """Return G of 0 = x_l x_b + y_l y_b, 0 = (x_l - x_r)^2 + (y_l - y_r)^2 - 1, (2, 4)."""
    xb, yb, *_ = road(t)
    dx, dy = 2 * (y[0] - y[2]), 2 * (y[1] - y[3])
    return np.array([[xb, yb, 0.0, 0.0], [dx, dy, -dx, -dy]])


def f(t: float, y: Array, z: Array) -> Array:
    """Return (v, v') with k v' = springs + weight + G^T lam."""
    xl, yl, xr, yr = y[:4].tolist()
    xb, yb, *_ = road(t)
    left, right = REST / hypot(xl, yl) - 1, REST / hypot(xr - xb, yr - yb) - 1
    force = [left * xl, left * yl - K * GRAVITY, right * (xr - xb), right * (yr - yb) - K * GRAVITY]
    return np.concatenate([y[4:], (force + z.dot(jacobian(t, y))) / K])


def f_y(t: float, y: Array, z: Array) -> Array:
    """Return the partial derivatives of f, (8, 8)."""
    xl, yl, xr, yr = y[:4].tolist()
    xb, yb, *_ = road(t)
    a, b, axle = spring(xl, yl), spring(xr - xb, yr - yb), 2 * z[1] * np.eye(2)
    force = np.block([[a + axle, -axle], [-axle, b + axle]])
    return np.block([[np.zeros((4, 4)), np.eye(4)], [force / K, np.zeros((4, 4))]])


def spring(x: float, y: float) -> Array:
    """Return the partial derivatives of a spring's force (L0/L - 1) (x, y), (2, 2)."""
    length, d = hypot(x, y), np.array([x, y])
    return (REST / length - 1) * np.eye(2) - REST / length**3 * np.outer(d, d)


def g(t: float, y: Array) -> Array:
    """Return G v + g_t, (2,)."""
    _, _, dxb, dyb, *_ = road(t)
    out: Array = jacobian(t, y).dot(y[4:])
    out[0] += y[0] * dxb + y[1] * dyb
    return out


def g_y(t: float, y: Array) -> Array:
    """Return the partial derivatives of g, (2, 8)."""
    _, _, dxb, dyb, *_ = road(t)
    dx, dy = 2 * (y[4] - y[6]), 2 * (y[5] - y[7])
    return np.hstack([[[dxb, dyb, 0.0, 0.0], [dx, dy, -dx, -dy]], jacobian(t, y)])


def g_t(t: float, y: Array) -> Array:
    """Return the partial time derivative of g, (2,)."""
    _, _, dxb, dyb, ddxb, ddyb = road(t)
    return np.array([y[4] * dxb + y[5] * dyb + y[0] * ddxb + y[1] * ddyb, 0.0])


def car_axis_equations() -> Hessenberg:
    """Two point masses on a massless axle, on springs over a bumpy road: positions, velocities, (8,), and lam, (2,).

        k x'' = (L0/L_l - 1) x_l + lam_1 x_b + 2 lam_2 (x_l - x_r), ...,   0 = x_l x_b + y_l y_b, ...

    The constraints are enforced at velocity level, which reduces the published index from 3 to 2.

    Source: F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4 (2008), II-9; S. Schneider,
    Integration de systemes d'equations differentielles raides et differentielles-algebriques (Geneva 1994).
    """
    return Hessenberg(
        f=f,
        g=g,
        y0=(0.0, 0.5, 1.0, 0.5, -0.5, 0.0, -0.5, 0.0),
        z0=(0.0, 0.0),
        g_y=g_y,
        f_z=lambda t, y, z: np.concatenate([np.zeros((4, 2)), jacobian(t, y).T / K]),
        g_t=g_t,
        f_y=f_y,
        name="car_axis_equations",
        title="Car axis, as equations",
    )
