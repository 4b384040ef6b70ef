"""Projection of a state on its closures, as an option at the ends of steps."""

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgesv

from ...errors import StepError
from ...system import Array
from ..closures.closure_error import largest_error

if TYPE_CHECKING:
    from .index2 import Index2System

TRUNCATION = 1e-7  # of the largest singular value of G M^-1/2
ITERATIONS = 10
ROUNDING = 1e-14  # of 1 + |q|, or of |v|: residuals below are left alone
FALLING = 0.5  # of |g|: a correction that leaves more of it is not taken
UNMOVED = 1e-13  # rad or m: what a projection moves by so little adds no slopes of its own
OPEN, STALLED = 1e-9, 1e-9  # residuals above, with corrections above, are a failure


def project_state(system: "Index2System", t: float, y: Array, tight: bool = False) -> Array:
    """Return the nearest point with g(t, q) = 0 and G(q) v + g_t = 0, q first and then v, over all rows.

    Rows of velocity have no part in q. Gauss-Newton steps of least |x| in the mass metric, x = -M^-1/2 (G M^-1/2)^+ g
    with a truncated pseudoinverse, M frozen; then v - M^-1/2 (G M^-1/2)^+ (G v + g_t). A step that does not halve |g|
    is not taken: near singular positions rounding in g stands for large corrections. Lengths are compared in
    characteristic lengths of the mechanism.

    Args:
        system: a workspace.
        t: time.
        y: the point.
        tight: go on below `ROUNDING` until |g| falls no more: near singular positions v turns by |g| / sigma^2.

    Raises:
        StepError: if the closures cannot be met from there.

    Source: Hairer, Wanner II, (VII.2.14), (VII.2.15).
    """
    if not system.ng:
        return y
    q, v = system.split(y)
    U = system.inertia(t, q)
    (*_, q), g, G, move = project_positions(system, t, q, U, tight)
    system.counts.state_projections += 1
    mech = system.mechanism
    if not np.linalg.norm(g / mech.row_scales) <= OPEN and not move <= STALLED * (1 + np.abs(q / mech.q_scales).max()):
        gap = largest_error(mech, g)
        raise StepError("newton", f"closure {gap.name!r} cannot be closed at t = {t:.17g}: it stays open by {gap.text}")
    rate = G @ v + system.g_t(t)
    if tight or speeds_felt(system, rate, v):
        v = v - _smallest(U, G, rate, mech.row_scales)
    return np.concatenate([q, v, y[system.nq + system.nv :]])


def project_positions(
    system: "Index2System", t: float, q: Array, U: Array, tight: bool = False
) -> tuple[list[Array], Array, Array, float]:
    """Take Gauss-Newton steps from q; kinematics stand there.

    Returns:
        The configurations from q to the end; g and G there; the largest component of the last step that was tried, in
        rad or characteristic lengths.
    """
    g, G = system.closures(None, t)
    path, move, kept, mech = [q], 0.0, system.constraints.positional, system.mechanism
    scales = mech.row_scales
    for _ in range(ITERATIONS):
        if not tight and not np.linalg.norm(g / scales) > ROUNDING * (1 + np.abs(path[-1] / mech.q_scales).max()):
            break
        x = _smallest(U, G[kept], g[kept], scales[kept])
        move = float(np.abs(x / mech.coordinate_scales).max())
        nearer = system.manifold.integrate(path[-1], -x)
        residual = system.closures(nearer, t)
        if not np.linalg.norm(residual[0] / scales) < FALLING * np.linalg.norm(g / scales):
            break
        path.append(nearer)
        g, G = residual
    return path, g, G, move


def speeds_felt(system: "Index2System", rate: Array, v: Array) -> bool:
    """Say whether G v + g_t, (ng,), is more than rounding; whatever it is where joints stick, which stand still."""
    mech = system.mechanism
    speed = np.abs(v / mech.coordinate_scales).max()
    return system.sticks or bool(np.linalg.norm(rate / mech.row_scales) > ROUNDING * speed)


def _smallest(U: Array, G: Array, r: Array, scales: Array) -> Array:
    """The x (nv,) of least |U x| with G x = r (ng,), by truncated least squares of rows by their scales."""
    B = dgesv(U.T, (G / scales[:, None]).T)[2]
    return dgesv(U, np.linalg.lstsq(B.T, r / scales, rcond=TRUNCATION)[0])[2]
