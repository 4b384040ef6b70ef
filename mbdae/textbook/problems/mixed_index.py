"""A problem of mixed index 1 and 2 that is nonlinear in z and u, with a known solution."""

import numpy as np

from ...system import Array
from ..mixed import MixedHessenberg
from .hessenberg_a import hessenberg_a

__all__ = ["mixed_index"]


def scalars(y: Array, z: Array, u: Array) -> tuple[float, float, float, float]:
    """Return y1, y2, z and u; arithmetic with Python's numbers is several times faster."""
    return *y.tolist(), *z.tolist(), *u.tolist()


def mixed_index() -> MixedHessenberg:
    """A problem with a multiplier z and an algebraic variable u of index 1.

        y1' = y1 y2^2 z u^2,  y2' = y1^2 y2^2 - 3 y2^2 u^2,  0 = y1^2 y2 - 1,  0 = u^3 + u - y1 z - y1

    Its solution is y = (e^t, e^-2t), z = e^2t, u = e^t. It is `hessenberg_a` with an index-1 variable in f:
    k_u = 3 u^2 + 1 is positive, u depends on z, and g_y (f_z - f_u k_u^-1 k_z) is at least 4/3 e^-2t.
    """

    def f(t, y, z, u):
        y1, y2, z1, u1 = scalars(y, z, u)
        return np.array([y1 * y2**2 * z1 * u1**2, (y1**2 - 3 * u1**2) * y2**2])

    def f_y(t, y, z, u):
        y1, y2, z1, u1 = scalars(y, z, u)
        return np.array(
            [[y2**2 * z1 * u1**2, 2 * y1 * y2 * z1 * u1**2], [2 * y1 * y2**2, 2 * (y1**2 - 3 * u1**2) * y2]]
        )

    def f_z(t, y, z, u):
        y1, y2, _, u1 = scalars(y, z, u)
        return np.array([[y1 * y2**2 * u1**2], [0.0]])

    def f_u(t, y, z, u):
        y1, y2, z1, u1 = scalars(y, z, u)
        return np.array([[2 * y1 * y2**2 * z1 * u1], [-6 * u1 * y2**2]])

    def k(t, y, z, u):
        y1, _, z1, u1 = scalars(y, z, u)
        return np.array([u1**3 + u1 - y1 * z1 - y1])

    base = hessenberg_a()
    return MixedHessenberg(
        f=f,
        g=base.g,
        k=k,
        f_y=f_y,
        f_z=f_z,
        f_u=f_u,
        g_y=base.g_y,
        g_t=base.g_t,
        k_y=lambda t, y, z, u: np.array([[-z[0] - 1, 0.0]]),
        k_z=lambda t, y, z, u: np.array([[-y[0]]]),
        k_u=lambda t, y, z, u: np.array([[3 * u.item() ** 2 + 1]]),
        y0=base.y0,
        z0=base.z0,
        u0=(1.0,),
        name="mixed_index",
        title="Problem of mixed index 1 and 2",
        exact=base.exact,
    )
