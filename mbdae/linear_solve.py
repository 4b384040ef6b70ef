"""Dense linear systems, real or complex, with errors of mbdae; and least squares."""

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.linalg.blas import dtrsv, ztrsv
from scipy.linalg.lapack import dgelsd, dgelsd_lwork, dgetrf, zgetrf

from .errors import StepError
from .system import Array


def factorized(matrix: Array, name: str) -> Callable[[Array], Array]:
    """Factorize a matrix by LU decomposition, and return the function b -> matrix^-1 b.

    Args:
        matrix: square matrix, real or complex, (n, n).
        name: name of the linear system, for messages.

    Raises:
        StepError: ``"nonfinite"``, if entries of the matrix or of its factors overflow or are not finite;
            ``"singular"``, if the matrix is singular.
    """
    getrf, trsv = (zgetrf, ztrsv) if np.iscomplexobj(matrix) else (dgetrf, dtrsv)
    lu, pivots, info = getrf(matrix)
    if not np.isfinite(lu).all():
        raise StepError("nonfinite", f"{name} has entries that are not finite")
    if info:
        raise StepError("singular", f"{name} is singular")
    order = list(range(len(pivots)))
    for i, k in enumerate(pivots.tolist()):
        order[i], order[k] = order[k], order[i]
    # not zgetrs: OpenBLAS uses several threads at any size, which changes rounding errors
    return lambda b: trsv(lu, trsv(lu, b[order], lower=1, diag=1, overwrite_x=1), overwrite_x=1)


def least_squares(A: Array, b: Array, rcond: float) -> Array:
    """Return the x (n,) of smallest norm with the smallest |A x - b|, A (m, n), b (m,), see `numpy.linalg.lstsq`.

    Of small systems, whose solution takes numpy five times as long.

    Args:
        A: the matrix.
        b: the right-hand side.
        rcond: singular values up to this fraction of the largest one count as zero.
    """
    m, n = A.shape
    if not m or not n:  # which LAPACK rejects
        return np.zeros(n)
    right = np.zeros(max(m, n))
    right[:m] = b
    x, _, _, info = dgelsd(A, right, *_workspace(m, n), rcond, overwrite_b=1)
    if info:
        raise np.linalg.LinAlgError("SVD did not converge in linear least squares")
    return x[:n]


@cache
def _workspace(m: int, n: int) -> tuple[int, int]:
    """Return the numbers of floating-point numbers and of integers that LAPACK works with."""
    numbers, integers, _ = dgelsd_lwork(m, n, 1)
    return int(numbers), integers
