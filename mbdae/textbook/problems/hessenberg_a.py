"""A problem that is nonlinear in z, with a known solution."""

import numpy as np

from ..hessenberg import Hessenberg

__all__ = ["hessenberg_a"]


def hessenberg_a() -> Hessenberg:
    """A problem that is nonlinear in z, with a known solution y = (e^t, e^-2t), z = e^2t.

        y1' = y1 y2^2 z^2,  y2' = y1^2 y2^2 - 3 y2^2 z,  0 = y1^2 y2 - 1

    Source: Murua, Computing 59 (1997).
    """

    def f(t, y, z):
        (y1, y2), (z1,) = y.tolist(), z.tolist()  # arithmetic with Python's numbers is several times faster
        return np.array([y1 * y2**2 * z1**2, y1**2 * y2**2 - 3 * y2**2 * z1])

    def f_z(t, y, z):
        (y1, y2), (z1,) = y.tolist(), z.tolist()
        return np.array([[2 * y1 * y2**2 * z1], [-3 * y2**2]])

    def g(t, y):
        y1, y2 = y.tolist()
        return np.array([y1**2 * y2 - 1])

    def g_y(t, y):
        y1, y2 = y.tolist()
        return np.array([[2 * y1 * y2, y1**2]])

    return Hessenberg(
        f=f,
        g=g,
        g_y=g_y,
        f_z=f_z,
        g_t=lambda t, y: np.zeros(1),
        y0=(1.0, 1.0),
        z0=(1.0,),
        name="hessenberg_a",
        title="Hessenberg problem (a)",
        exact=lambda t: (np.array([np.exp(t), np.exp(-2 * t)]), np.array([np.exp(2 * t)])),
    )
