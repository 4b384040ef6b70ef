"""Floquet multipliers: eigenvalues of the product of the tangents over the segments of one period.

The product M_k ... M_1 has entries as large as the largest multiplier, so its small eigenvalues have no correct digits.
Orthogonal iteration over the factors, M_i Q_i-1 = Q_i R_i, leads to a periodic Schur form: the diagonal blocks of the
R_i, multiplied block by block, have all multipliers.
Source: Bojanczyk, Golub, Van Dooren, The periodic Schur decomposition (1992); Lust,
Int. J. Bifurcation Chaos 11 (2001).
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import schur

from ....system import Array
from ....tolerances import RANK, SUM_ROUNDING

MAX_SWEEPS = 100


def periodic_eigenvalues(factors: Sequence[Array]) -> Array:
    """Return the eigenvalues of M_k ... M_1, (n,), complex, by decreasing magnitude.

    Args:
        factors: M_1, ..., M_k, each (n, n), in the order in which they act.
    """
    n = len(factors[0])
    if not n:
        return np.empty(0, complex)
    if len(factors) == 1:
        return _sorted(np.linalg.eigvals(factors[0]))
    Q = schur(np.linalg.multi_dot(factors[::-1]))[1]
    for _ in range(MAX_SWEEPS):
        triangular, Z = [], Q
        for M in factors:
            Z, R = np.linalg.qr(M @ Z)
            triangular.append(R)
        Q_return, Q = Q.T @ Z, Z
        blocks = _blocks(Q_return)
        if max(b.stop - b.start for b in blocks) == 1:
            break
    return _sorted(np.concatenate([_block_eigenvalues(Q_return[b, b], [R[b, b] for R in triangular]) for b in blocks]))


def _blocks(Q_return: Array) -> list[slice]:
    """Return the decoupled diagonal blocks of an orthogonal matrix (n, n), up to rounding."""
    n, starts = len(Q_return), [0]
    for i in range(1, n):
        coupling = max(np.abs(Q_return[i:, :i]).max(), np.abs(Q_return[:i, i:]).max())
        if coupling <= SUM_ROUNDING * n:
            starts.append(i)
    return [slice(a, b) for a, b in zip(starts, [*starts[1:], n], strict=True)]


def _block_eigenvalues(Q_return: Array, factors: Sequence[Array]) -> Array:
    """Return the eigenvalues of Q_return R_k ... R_1 of one block, whose multipliers have similar magnitudes."""
    product, scale = np.eye(len(Q_return)), 0.0
    for R in factors:  # scaled, since products overflow
        size = np.linalg.norm(R) or 1.0
        product, scale = (R / size) @ product, scale + np.log(size)
    return np.linalg.eigvals(Q_return @ product).astype(complex) * np.exp(scale)


def _sorted(values: Array) -> Array:
    return values[np.lexsort((-values.imag, -np.abs(values)))].astype(complex)


def on_quotient(factors: Sequence[Array], known: Sequence[Array]) -> list[Array]:
    """Return the factors on the orthogonal complements of known directions.

    Invariant columns W_i, M_i W_i-1 in span W_i, are factored out to a quotient; invariant rows E_i, E_i M_i in span
    E_i-1, with E_i W_i = 0, restrict it to a subspace.

    Args:
        factors: M_1, ..., M_k, each (n, n).
        known: [W_i, E_i^T] at the start of each segment, (n, m_i), with the same number of independent columns.
    """
    bases = []
    for columns in known:
        U, S, _ = np.linalg.svd(columns)
        bases.append(U[:, np.count_nonzero(RANK * S[:1].max(initial=0.0) < S) :])
    return [end.T @ M @ start for M, start, end in zip(factors, bases, [*bases[1:], bases[0]], strict=True)]
