"""Dense linear systems, real or complex, with the library's error."""

from collections.abc import Callable

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs, zgetrf, zgetrs

from .errors import StepError

Array = np.ndarray


def factorized(matrix: Array, message: str) -> Callable[[Array], Array]:
    """Return b -> matrix^-1 b.

    Args:
        matrix: square, real or complex, (n, n).
        message: of the error.

    Raises:
        StepError: ``"singular"`` with the message, where no factorization exists.
    """
    getrf, getrs = (zgetrf, zgetrs) if np.iscomplexobj(matrix) else (dgetrf, dgetrs)
    lu, pivots, info = getrf(matrix)
    if info or not np.isfinite(lu).all():
        raise StepError("singular", message)
    return lambda b: getrs(lu, pivots, b)[0]
