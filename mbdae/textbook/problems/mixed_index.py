"""A problem of mixed index 1 and 2 that is nonlinear in z and u, with a known solution."""

import numpy as np

from ..mixed import MixedHessenberg

__all__ = ["mixed_index"]


def mixed_index() -> MixedHessenberg:
    """A problem with a multiplier z and an algebraic variable u that solves locally.

        y1' = y1 y2^2 z u^2,  y2' = y1^2 y2^2 - 3 y2^2 u^2,  0 = y1^2 y2 - 1,  0 = u^3 + u - y1 z - y1

    Its solution is y = (e^t, e^-2t), z = e^2t, u = e^t. It is `hessenberg_a` with an equation of index 1 in f:
    k_u = 3 u^2 + 1 is positive, u depends on z, and g_y (f_z - f_u k_u^-1 k_z) is at least 4/3 e^-2t.
    """

    def f(t, y, z, u):
        return np.array([y[0] * y[1] ** 2 * z[0] * u[0] ** 2, (y[0] ** 2 - 3 * u[0] ** 2) * y[1] ** 2])

    def f_y(t, y, z, u):
        return np.array(
            [
                [y[1] ** 2 * z[0] * u[0] ** 2, 2 * y[0] * y[1] * z[0] * u[0] ** 2],
                [2 * y[0] * y[1] ** 2, 2 * (y[0] ** 2 - 3 * u[0] ** 2) * y[1]],
            ]
        )

    return MixedHessenberg(
        f=f,
        g=lambda t, y: np.array([y[0] ** 2 * y[1] - 1]),
        k=lambda t, y, z, u: np.array([u[0] ** 3 + u[0] - y[0] * z[0] - y[0]]),
        f_y=f_y,
        f_z=lambda t, y, z, u: np.array([[y[0] * y[1] ** 2 * u[0] ** 2], [0.0]]),
        f_u=lambda t, y, z, u: np.array([[2 * y[0] * y[1] ** 2 * z[0] * u[0]], [-6 * u[0] * y[1] ** 2]]),
        g_y=lambda t, y: np.array([[2 * y[0] * y[1], y[0] ** 2]]),
        g_t=lambda t, y: np.zeros(1),
        k_y=lambda t, y, z, u: np.array([[-z[0] - 1, 0.0]]),
        k_z=lambda t, y, z, u: np.array([[-y[0]]]),
        k_u=lambda t, y, z, u: np.array([[3 * u[0] ** 2 + 1]]),
        y0=(1.0, 1.0),
        z0=(1.0,),
        u0=(1.0,),
        name="mixed_index",
        title="Problem of mixed index 1 and 2",
        exact=lambda t: (np.array([np.exp(t), np.exp(-2 * t)]), np.array([np.exp(2 * t)])),
    )
