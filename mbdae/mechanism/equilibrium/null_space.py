"""Null space of the closures at a configuration, orthonormal in the mass metric.

    M = U^T U,   R^-1 G U^-1 = P S V^T,   rank r,   Z = U^-1 V_2:   G Z = 0,  Z^T M Z = 1

R = diag(row scales) makes the rank independent of units. Statics and modes move along Z and then close the loops by
Gauss-Newton steps of minimum norm in the coordinates: in the mass metric a light body would receive the entire
correction, even if it cannot close the loop.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import StepError
from ...linear_solve import lapack
from ...system import Array
from ...tolerances import CLOSED, RANK
from ..closures import independent_rows
from ..closures.closure_error import largest_error

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System

ITERATIONS = 20
MAX_REMAINING = 0.5  # largest fraction of a residual after a full correction; more is rounding or an overshoot
STEP_FACTORS = (1.0, 0.5, 0.25, 0.125)  # factors of corrections
NO_INDICES = np.empty(0, int)
ResidualFunction = Callable[[Array], tuple[Array, Array]]
"""Further residuals (k,) at a configuration (nq,), with current kinematics of the workspace, and partials (k, nv)."""


class NullSpace(NamedTuple):
    """Null space of constraint rows.

    Attributes:
        U: Cholesky factor of M = U^T U, (nv, nv).
        P, S, V: factors of R^-1 G U^-1 = P diag(S) V^T, truncated to the rank, (m, r), (r,), (nv, r).
        Z: basis of the null space, (nv, k), G Z = 0, Z^T M Z = 1.
        dependent: orthonormal basis of multipliers without force, G^T lam = 0, (m, m - r).
        scale: unit scales of the rows, (m,).
    """

    U: Array
    P: Array
    S: Array
    V: Array
    Z: Array
    dependent: Array
    scale: Array

    @property
    def smallest(self) -> float:
        """Smallest nonzero singular value; 1 without rows."""
        return float(self.S[-1]) if len(self.S) else 1.0

    def multipliers(self, f: Array) -> Array:
        """Return the minimum-norm lam (m,) with f + G^T lam = M Z x: inertial forces along the null space."""
        lam = -(self.P @ ((self.V.T @ lapack().dgesv(self.U.T, f)[2]) / self.S)) / self.scale
        return lam - self.dependent @ (self.dependent.T @ lam)

    def minimum_norm_solution(self, r: Array) -> Array:
        """Return the x (nv, ...) of smallest |U x| with G x = r (m, ...), in the least-squares sense of R^-1 r."""
        return lapack().dgesv(self.U, self.V @ ((self.P.T @ (r.T / self.scale).T).T / self.S).T)[2]


def constraint_null_space(U: Array, G: Array, scale: Array, coordinates: Array) -> NullSpace:
    """Return the null space of constraint rows, and the factors of their pseudoinverse.

    Args:
        U: Cholesky factor of M = U^T U, (nv, nv).
        G: rows, (m, nv).
        scale: unit scales of the rows, (m,).
        coordinates: unit scales of the coordinates, (nv,).
    """
    nv = len(U)
    if not len(G):
        empty = np.empty((0, 0))
        return NullSpace(U, empty, np.empty(0), np.empty((nv, 0)), lapack().dgesv(U, np.eye(nv))[2], empty, scale)
    rows = G / scale[:, None]
    P, S, Vt = np.linalg.svd(independent_rows.mass_scaled(U, rows).T)
    r = int((S[0] * RANK < S).sum())
    if r < min(G.shape):  # light bodies among heavy ones
        r = max(r, independent_rows.geometric_rank(rows * coordinates))
    dependent = np.linalg.qr(P[:, r:] / scale[:, None])[0]
    return NullSpace(U, P[:, :r], S[:r], Vt[:r].T, lapack().dgesv(U, Vt[r:].T)[2], dependent, scale)


def project_configuration(
    system: "Index2System", t: float, q: Array, more: ResidualFunction | None = None, *, locked: Array = NO_INDICES
) -> Array:
    """Project a configuration (nq,) onto 0 = g and further rows, to rounding.

    Gauss-Newton steps have minimum norm in rad and characteristic lengths; a step reduced by a factor is accepted if it
    reduces the residual by at least half of that factor. Coordinates with the velocity indices ``locked`` keep their
    values.

    Raises:
        StepError: if rows remain violated.
    """
    units, length = system.mechanism.row_scales, system.mechanism.coordinate_scales

    def residual(x: Array) -> tuple[Array, Array]:
        g, G = system.closures(x, t)
        g, G = g / units, G / units[:, None]
        if more is not None:
            r, R = more(x)
            g, G = np.concatenate([g, r]), np.vstack([G, R])
        G[:, locked] = 0.0
        return g, G

    if not system.ng and more is None:
        return q
    one = np.diag(1 / length)
    g, G = residual(q)
    for _ in range(ITERATIONS):
        size = np.linalg.norm(g)
        if not size or not np.isfinite(size):
            break
        x = constraint_null_space(one, G, np.ones(len(G)), length).minimum_norm_solution(-g)
        for factor in STEP_FACTORS if size > CLOSED else STEP_FACTORS[:1]:
            new_q = system.manifold.integrate(q, factor * x)
            new = residual(new_q)
            if np.linalg.norm(new[0]) < (1 - MAX_REMAINING * factor) * size:
                break
        else:
            break
        q, (g, G) = new_q, new
    if not np.linalg.norm(g) <= CLOSED:
        if len(g) > system.ng and np.linalg.norm(g[: system.ng]) <= CLOSED:
            raise StepError("newton", "the references of controllers cannot be reached")
        violation = largest_error(system.mechanism, g[: system.ng] * units)
        raise StepError("newton", f"{violation.message()} at t = {t:.17g} and cannot be satisfied")
    return q
