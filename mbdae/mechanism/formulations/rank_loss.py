"""Null spaces of the rows and of their transpose near singular configurations, by dense matrices."""

from typing import TYPE_CHECKING

import numpy as np

from ...linear_solve import lapack, least_squares
from ...system import Array
from ..closures import independent_rows
from ..signals.reactions import mass_scaled_jacobian

if TYPE_CHECKING:
    from .index2 import Index2System


def null_spaces(system: "Index2System", configurations: list[Array]) -> list[Array]:
    """Return an orthonormal basis (nv, nv - r) of the null space of G, of rank r, at each q, in rad and lengths.

    Components of velocities are divided by the coordinate scales.
    """
    scales = system.mechanism.coordinate_scales
    return [np.linalg.svd(system.jacobian(q) * scales)[2][system.rank or 0 :].T for q in configurations]


def vanishing_combinations(
    system: "Index2System", t: float, q: Array, rank: int, limit: float, vectors: Array
) -> tuple[int, Array]:
    """Project vectors (ng, k) onto the null space of G^T, the combinations of rows that vanish at a configuration.

    Args:
        system: a workspace.
        t: time.
        q: the configuration.
        rank: largest number of independent rows.
        limit: pivots of independent rows exceed this fraction of the largest pivot.
        vectors: the vectors.

    Returns:
        Number of independent rows; the projections (ng, k).
    """
    G = mass_scaled_jacobian(system, t, q)
    pivots = independent_rows.pivots(G.T)[1]
    r = min(rank, int(np.count_nonzero(pivots > limit * pivots[0])))
    left = np.linalg.svd(G)[0][:, r:]
    return r, left @ (left.T @ vectors)


def residual_of_dependent_rows(system: "Index2System", t: float, q: Array, limit: float, steps: int) -> float:
    """Return the largest |g| relative to the largest entry of G, after Gauss-Newton steps by the independent rows.

    Args:
        system: a workspace.
        t: time.
        q: configuration before these steps.
        limit: ratio of singular values that counts as zero.
        steps: number of steps.
    """
    for _ in range(steps):
        U = system.inertia(t, q)
        g, G = system.closures(None, t)
        B = independent_rows.mass_scaled(U, G)
        q = system.manifold.integrate(q, -lapack().dgesv(U, least_squares(B.T, g, limit))[2])
    g, G = system.closures(q, t)
    return float(np.abs(g).max() / np.abs(G).max())
