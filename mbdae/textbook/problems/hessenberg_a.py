"""A problem that is nonlinear in z, with a known solution."""

import numpy as np

from ..hessenberg import Hessenberg

__all__ = ["hessenberg_a"]


def hessenberg_a() -> Hessenberg:
    """A problem that is nonlinear in z, with a known solution y = (e^t, e^-2t), z = e^2t.

        y1' = y1 y2^2 z^2,  y2' = y1^2 y2^2 - 3 y2^2 z,  0 = y1^2 y2 - 1

    Source: Murua, Appl. Numer. Math. 24 (1997), section 5.
    """
    return Hessenberg(
        f=lambda t, y, z: np.array([y[0] * y[1] ** 2 * z[0] ** 2, y[0] ** 2 * y[1] ** 2 - 3 * y[1] ** 2 * z[0]]),
        g=lambda t, y: np.array([y[0] ** 2 * y[1] - 1]),
        g_y=lambda t, y: np.array([[2 * y[0] * y[1], y[0] ** 2]]),
        f_z=lambda t, y, z: np.array([[2 * y[0] * y[1] ** 2 * z[0]], [-3 * y[1] ** 2]]),
        g_t=lambda t, y: np.zeros(1),
        y0=(1.0, 1.0),
        z0=(1.0,),
        name="hessenberg_a",
        title="Hessenberg problem (a)",
        exact=lambda t: (np.array([np.exp(t), np.exp(-2 * t)]), np.array([np.exp(2 * t)])),
    )
