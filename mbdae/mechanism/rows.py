"""Dependent constraint rows: rank, and a well-conditioned choice of independent rows."""

import numpy as np
from scipy.linalg.lapack import dgeqp3

RANK_TOLERANCE = 1e-8
WORST_CONDITIONING = 0.1
GROWN = 1e-2


def pivots(B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pivoted QR of B (nv, m): column order (m,) and |diag R| (min(nv, m),), decreasing."""
    qr, order, *_ = dgeqp3(B)
    return order - 1, np.abs(np.diagonal(qr))


def rank(diagonal: np.ndarray) -> int:
    """Number of pivots above 1e-8 of the largest."""
    return int((diagonal > RANK_TOLERANCE * diagonal.max(initial=0.0)).sum())


def grown(diagonal: np.ndarray, r: int) -> bool:
    """True when rows beyond the rank r are no longer dependent: their pivot exceeds a hundredth of the largest.

    Smaller ones come from drift: rows that depend on each other on 0 = g do so only nearly beside it.
    """
    return len(diagonal) > r and bool(diagonal[r] > GROWN * diagonal[0])


def choose(B: np.ndarray, rows: np.ndarray | None, r: int) -> np.ndarray:
    """Choose r independent columns of B = M^{-1/2} G^T, (nv, ng): the rows in use as long as they serve.

    They are given up when their smallest pivot falls below a tenth of the best choice's.

    Args:
        B: scaled transposed constraint Jacobian.
        rows: the rows in use, (r,), or None at the start.
        r: how many.

    Returns:
        Sorted indices, (r,).
    """
    order, best = pivots(B)
    if rows is not None and (
        len(rows) == B.shape[1] or pivots(B[:, rows])[1][r - 1] >= WORST_CONDITIONING * best[r - 1]
    ):
        return rows
    return np.sort(order[:r])


def minimum_norm(G: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The multipliers of smallest norm, (ng,), with G^T lam = force (nv,) for dependent rows of G (ng, nv)."""
    return np.linalg.lstsq(G.T, force, rcond=RANK_TOLERANCE)[0]
