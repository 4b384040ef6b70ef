"""Projection of velocities onto G v + g_t = 0 at a configuration, in the mass metric."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ...backend import load
from ...errors import InputError
from ...linear_solve import lapack
from ...system import Array
from ...tolerances import AGREEMENT, TRUNCATION
from ..closures.closure_error import largest_error
from ..closures.independent_rows import MANY_ROWS
from ..run_parameters import RunParameters
from ..tree.tree_terms import missing_inertia, sparse_inertia, symmetric, update_inertia
from .flipped_frames import divide_rows
from .position_search import assembly_error, sparse_least_squares

if TYPE_CHECKING:
    from ..formulations.core_start import CoreStart
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism


class VelocityProjection:
    """Projection of velocities, some of them fixed, onto G v + g_t = 0 at q and t; variants may share it."""

    def __init__(self, system: "Index2System", q: Array, fixed: Array, t: float) -> None:
        self.q, self.fixed, self.free = q, fixed, np.delete(np.arange(system.nv), fixed)
        self.G, self.g_t = system.closures_dense_or_sparse(q, t)[1], system.g_t(t).copy()
        self.rows, self.scales = system.mechanism.row_scales, system.mechanism.coordinate_scales
        self._correction: Callable[[Array], Array] | None = None

    def project(self, system: "Index2System", v: Array, parameters: RunParameters) -> Array:
        """Return the velocities closest to v (.., nv) in the mass metric with G v + g_t = 0, (.., nv).

        Args:
            system: a workspace of the mechanism.
            v: velocities.
            parameters: inertia parameters of k runs, in the core, for velocities (k, nv).

        Raises:
            AssemblyError: if the fixed velocities contradict the closures.
            InputError: if a massless body makes the mass metric singular.
        """
        g_t, rows = self.g_t, self.rows
        residual = _times(self.G, v) + g_t
        if not np.count_nonzero(residual):
            return v
        if parameters.locations:
            with system.mechanism.workspaces.borrowed(load()) as compiled:
                masses = cast("CoreStart", compiled).mass_matrices(self.q, parameters)
            correction = self._minimum_norm_correction(system, masses)
        else:
            correction = self._correction = self._correction or self._minimum_norm_correction(system)
        speeds = np.linalg.norm(v / self.scales, axis=-1) + np.linalg.norm(g_t / rows)
        for _ in range(2):  # the second pass removes rounding
            v = v - correction(residual / rows)
            residual = _times(self.G, v) + g_t
        violated = ~(np.linalg.norm(residual / rows, axis=-1) <= AGREEMENT * speeds)
        if violated.any():
            mech, first = system.mechanism, residual.reshape(-1, len(rows))[np.argmax(violated)]
            raise assembly_error(mech, largest_error(mech, first, "/s"), self.fixed, "velocity")
        return v

    def _minimum_norm_correction(self, system: "Index2System", masses: Array | None = None) -> Callable[[Array], Array]:
        """Return r -> M^-1 G^T (G M^-1 G^T)^+ r: the correction (.., nv) of minimum norm for residuals r (.., ng).

        Residuals and G are scaled by rows. The mass matrices (.., nv, nv) default to that of the mechanism.
        """
        G, many = self.G[:, self.free], system.ng > MANY_ROWS and masses is None
        if many:
            M: Any = sparse_inertia(system.model, system.workspace, self.q)[:, self.free][self.free]
        else:
            M = symmetric(update_inertia(system.model, system.workspace, self.q)) if masses is None else masses
            M = M[..., self.free[:, None], self.free]
        if not (many and _has_positive_pivots(M)):
            U = self._cholesky(system.mechanism, M.toarray() if many else M)
        if many:
            scaled = G.copy()
            divide_rows(scaled, self.rows)
            return partial(_sparse_correction, scaled, M, self.free, system.nv)  # partial, since it can be pickled
        # G M^-1/2, like `mass_scaled`, but without scipy
        root = np.linalg.solve(U.swapaxes(-2, -1), (G / self.rows[:, None]).T).swapaxes(-2, -1)
        correction = np.zeros((*M.shape[:-2], system.nv, system.ng))
        correction[..., self.free, :] = np.linalg.solve(U, np.linalg.pinv(root, rcond=TRUNCATION))
        return partial(_times, correction)

    def _cholesky(self, mech: "Mechanism", M: Array) -> Array:
        """Return the upper triangular U with U^T U = M, by numpy, so that most runs do not import scipy."""
        try:
            return np.linalg.cholesky(M).swapaxes(-2, -1)
        except np.linalg.LinAlgError:
            M = M.reshape(-1, *M.shape[-2:])[0]
            i = lapack().dpotrf(M, lower=1)[1] or len(M)
            joint = mech.coordinate_joint(int(self.free[i - 1]))
            why = missing_inertia(mech.model, joint)
            raise InputError(f"the mass matrix is singular at joint {joint!r}: {why}") from None


def _sparse_correction(G: Any, M: Any, free: Array, nv: int, residual: Array) -> Array:
    correction = np.zeros((*residual.shape[:-1], nv))
    for x, r in zip(correction.reshape(-1, nv), residual.reshape(-1, residual.shape[-1]), strict=True):
        x[free] = sparse_least_squares(G, r, 0.0, M)
    return correction


def _times(A: Any, x: Array) -> Array:
    """Return A x for a matrix A (m, n) and vectors x (.., n), (.., m), bitwise equal to single products."""
    if isinstance(A, np.ndarray):
        return np.matmul(A, x[..., None])[..., 0]
    return A @ x if x.ndim == 1 else np.array([A @ column for column in x])


def _has_positive_pivots(M: Any) -> bool:
    """Return whether elimination from the leaves of the tree, without fill-in, has positive pivots."""
    from scipy.sparse.linalg import splu

    try:
        inward = M[::-1][:, ::-1].tocsc()
        factors = splu(inward, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # exactly singular
        return False
    return bool((factors.U.diagonal() > 0).all())
