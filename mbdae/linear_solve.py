"""Solution of dense linear systems, real or complex, with errors of mbdae, and of least-squares problems."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from types import ModuleType

import numpy as np

from .errors import StepError
from .system import Array


@cache
def lapack() -> ModuleType:
    """Return scipy's LAPACK, imported on first use: runs in the core do not need it."""
    return import_module("scipy.linalg.lapack")


@cache
def _blas() -> ModuleType:
    return import_module("scipy.linalg.blas")


def factorized(matrix: Array, name: str) -> Callable[[Array], Array]:
    """Factorize a matrix by LU decomposition, and return the function b -> matrix^-1 b.

    Args:
        matrix: square matrix, real or complex, (n, n).
        name: name of the linear system, for messages.

    Raises:
        StepError: ``"nonfinite"``, if entries of the matrix or of its factors overflow or are not finite;
            ``"singular"``, if the matrix is singular.
    """
    is_complex = np.iscomplexobj(matrix)
    lu, pivots, info = (lapack().zgetrf if is_complex else lapack().dgetrf)(matrix)
    if not np.isfinite(lu).all():
        raise StepError("nonfinite", f"{name} has entries that are not finite")
    if info:
        raise StepError("singular", f"{name} is singular")
    permutation = list(range(len(pivots)))
    for i, k in enumerate(pivots.tolist()):
        permutation[i], permutation[k] = permutation[k], permutation[i]
    trsv = _blas().ztrsv if is_complex else _blas().dtrsv
    # not zgetrs: OpenBLAS uses several threads at any size, which changes rounding errors
    return lambda b: trsv(lu, trsv(lu, b[permutation], lower=1, diag=1, overwrite_x=1), overwrite_x=1)


def least_squares(A: Array, b: Array, rcond: float) -> Array:
    """Return the x (n,) of smallest norm with the smallest |A x - b|, A (m, n), b (m,), see `numpy.linalg.lstsq`.

    For small systems, for which numpy takes five times as long.

    Args:
        A: the matrix.
        b: the right-hand side.
        rcond: singular values up to this fraction of the largest one count as zero.
    """
    m, n = A.shape
    if not m or not n:  # LAPACK rejects empty matrices
        return np.zeros(n)
    rhs = np.zeros(max(m, n))
    rhs[:m] = b
    x, _, _, info = lapack().dgelsd(A, rhs, *_workspace(m, n), rcond, overwrite_b=1)
    if info:
        raise np.linalg.LinAlgError("SVD did not converge in linear least squares")
    return x[:n]


@cache
def _workspace(m: int, n: int) -> tuple[int, int]:
    """Return the sizes of LAPACK's workspaces: floating-point numbers and integers."""
    numbers, integers, _ = lapack().dgelsd_lwork(m, n, 1)
    return int(numbers), integers
