"""A point that moves around a circle at unit speed."""

import numpy as np

from ..hessenberg import Hessenberg

__all__ = ["circle"]


def circle() -> Hessenberg:
    """A point on the unit circle, with the solution y = (cos t, sin t), z = 0.

        y1' = -y2 + z y1,   y2' = y1 + z y2,   0 = y1^2 + y2^2 - 1

    The smallest problem in which stages of a method may violate the constraint.
    """
    return Hessenberg(
        f=lambda t, y, z: np.array([-y[1] + z[0] * y[0], y[0] + z[0] * y[1]]),
        g=lambda t, y: np.array([y @ y - 1.0]),
        g_y=lambda t, y: 2 * y[None],
        f_z=lambda t, y, z: y[:, None].copy(),
        g_t=lambda t, y: np.zeros(1),
        f_y=lambda t, y, z: np.array([[z[0], -1.0], [1.0, z[0]]]),
        y0=(1.0, 0.0),
        z0=(0.0,),
        name="circle",
        title="Point on a circle",
        duration=6.0,
        exact=lambda t: (np.array([np.cos(t), np.sin(t)]), np.zeros(1)),
    )
