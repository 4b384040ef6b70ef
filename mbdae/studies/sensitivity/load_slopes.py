"""How forces and torques in joints and closures move with the state, the parameters and the time of a node.

They are a function of (t, q, v, v', lam) and of the mechanism's numbers (`mbdae.mechanism.joint_wrenches`). v' and lam,
on which they depend linearly, have exact slopes; along the others the function alone is differentiated, by differences
of order six, in which nothing of a run is repeated.
"""

from typing import Any

import numpy as np

from ... import differences
from ...integrate.trace import Trace
from ...mechanism import point_loads
from ...system import Array

WIDTH = 1e-3  # rad, m, their rates, or s: of differences


def load_slopes(trace: Trace, t: float, y: Array) -> tuple[Array, Array]:
    """Return the vectors of `mbdae.mechanism.joint_wrenches.loads`, (2, n, 3), and their slopes, (2, n, 3, ny + k + 1).

    The first half is along the world's axes, the other along their own; force and torque stand in turn. The trace holds
    the rows in use.
    """
    s, slopes, near = trace.system, trace.slopes, trace.slopes.near
    (q, v), nv, ny = s.split(y), s.nv, s.ny
    F, lam = s.derivative(t, y)
    vdot, lam, moves = F[nv : 2 * nv], lam[: s.ng], slopes.rate(t, y)

    def at(t: float, q: Array, v: Array, vdot: Array = vdot, lam: Array = lam, system: Any = s) -> Array:
        return np.array(point_loads(system, t, q, v, vdot, lam)).reshape(2, -1, 3)

    here = at(t, q, v)
    out = np.zeros((*here.shape, ny + slopes.k + 1))
    out[..., :nv] = differences.slopes(lambda x: at(t, s.manifold.integrate(q, x), v), nv, WIDTH)
    out[..., nv : 2 * nv] = differences.slopes(lambda x: at(t, q, v + x), nv, WIDTH)
    out[..., -1] = differences.slope(lambda x: at(t + x, q, v), WIDTH)
    for i, (p, others) in enumerate(zip(slopes.parameters.all, near, strict=True)):
        out[..., ny + i] = p.quotient({m: at(t, q, v, system=other) for m, other in others.items()})
    for i, (dvdot, dlam) in enumerate(zip(moves.rate[nv : 2 * nv].T, moves.lam.T, strict=True)):
        out[..., i] += at(t, q, v, vdot + dvdot, lam + dlam) - here
    return here, out


def load_row(found: tuple[Array, Array], i: int) -> Array:
    """Return the slopes of a column of `mbdae.solution.columns.load_columns`, (ny + k + 1,): of a magnitude or part."""
    vectors, slopes = found
    which, part = divmod(i, 1 + 2 * 3)
    if part:
        axes, part = divmod(part - 1, 3)
        return slopes[axes, which, part]
    vector = vectors[0, which]
    return vector / (np.linalg.norm(vector) or 1.0) @ slopes[0, which]
