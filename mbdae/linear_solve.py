"""Dense linear systems, real or complex, with errors of mbdae."""

from collections.abc import Callable

import numpy as np
from scipy.linalg.blas import dtrsv, ztrsv
from scipy.linalg.lapack import dgetrf, zgetrf

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
