"""Eigenvalues of a matrix whose entries are known up to rounding.

The error bound e of a matrix A, |dA| <= e in each entry, is eps times the magnitudes of the summed terms. The
linearized motion [0 1; -M^-1 K  -M^-1 D] contains ones and squares of frequencies, so that no norm decides which of its
entries are zero. An entry is treated as zero if none of its digits is significant, |a| <= 100 e, independently of units
and of other motions.

The rank comes from elimination in the order of certainty, |a|/e, which is invariant under scaling of rows and columns,
with a running error bound. Null vectors X = [1 in the free columns f; B in the pivot columns o] are deflated along unit
vectors,

    A <- A_oo - B A_fo,   e <- e_oo + |B| e_fo + eps |B| |A_fo|,

repeatedly, since zeros form Jordan chains (rigid motions and their velocities). An orthonormal complement would mix the
largest frequencies into the smallest. Source of the bound: Wilkinson, Rounding Errors in Algebraic Processes (1963);
of the errors of eigenvalues: Stewart, Sun, Matrix Perturbation Theory (1990), theorem IV.2.3.

With left and right eigenvectors y and x, the error bound of the real part of an eigenvalue is
sum |Re(conj(y_i) x_j / y^H x)| e_ij, that of the imaginary part the same sum with Im. Without damping, errors of the
stiffness change only frequencies, so that a damping ratio of 1e-12 is significant although the stiffness is known to
within 1e-10. Insignificant parts are set to 0.
"""

from typing import NamedTuple

import numpy as np

from ...discovery import lazy_import
from ...system import Array
from ...tolerances import EPS

eig = lazy_import("scipy.linalg", "eig")
solve_triangular = lazy_import("scipy.linalg", "solve_triangular")

CERTAIN = 100.0  # multiple of its rounding error above which a number is known to be nonzero


class MatrixNullSpace(NamedTuple):
    """Null space of a matrix, x_o = B x_f.

    Attributes:
        rows: rows in the order of their pivots, rows without pivot last.
        pivots: columns o with a pivot, (r,).
        free: columns f without a pivot, (n - r,).
        B: null vectors in the pivot columns, (r, n - r).
    """

    rows: Array
    pivots: Array
    free: Array
    B: Array

    @property
    def vectors(self) -> Array:
        """Null vectors as columns, (n, n - r)."""
        out = np.zeros((len(self.pivots) + len(self.free), len(self.free)))
        out[self.free], out[self.pivots] = np.eye(len(self.free)), self.B
        return out


def null_space(A: Array, e: Array) -> MatrixNullSpace:
    """Return the null space of A (m, n), whose entries are known to within e (m, n)."""
    a, (m, n) = A.astype(float), A.shape
    e = np.maximum(e, EPS * np.abs(a))
    rows, columns, r = np.arange(m), np.arange(n), 0
    while r < min(m, n):
        rest = np.abs(a[r:, r:])
        known = np.divide(rest, e[r:, r:], out=np.zeros_like(rest), where=rest > 0)
        i, j = np.unravel_index(known.argmax(), known.shape)
        if not known[i, j] > CERTAIN:
            break
        for x in (a, e):
            x[[r, r + i]] = x[[r + i, r]]
            x[:, [r, r + j]] = x[:, [r + j, r]]
        rows[[r, r + i]], columns[[r, r + j]] = rows[[r + i, r]], columns[[r + j, r]]
        factor, row = a[r + 1 :, r] / a[r, r], a[r, r + 1 :]
        size = np.abs(factor)[:, None]
        bound = (e[r + 1 :, r] + np.abs(factor) * e[r, r]) / abs(a[r, r])
        e[r + 1 :, r + 1 :] += size * e[r, r + 1 :] + (bound[:, None] + EPS * size) * np.abs(row)
        a[r + 1 :, r + 1 :] -= factor[:, None] * row
        a[r + 1 :, r] = 0.0
        r += 1
    B = -solve_triangular(a[:r, :r], a[:r, r:]) if r else np.empty((0, n))
    return MatrixNullSpace(rows, columns[:r], columns[r:], B)


class Spectrum(NamedTuple):
    """Eigenvalues of A (n, n), exact zeros first.

    Attributes:
        values: eigenvalues (n,), complex; insignificant real and imaginary parts are 0.
        vectors: right eigenvectors as columns, (n, n), complex; 0 for zeros of a chain without an eigenvector.
        known: whether each value is larger than 100 times its rounding error, (n,); true for exact zeros.
    """

    values: Array
    vectors: Array
    known: Array

    @property
    def growing(self) -> Array:
        """Whether the real part of each value is positive beyond rounding, (n,)."""
        return self.known & (self.values.real > 0)

    def sorted(self, order: Array) -> "Spectrum":
        """Return the spectrum in another order."""
        return Spectrum(self.values[order], self.vectors[:, order], self.known[order])


def spectrum(A: Array, e: Array) -> Spectrum:
    """Return eigenvalues and eigenvectors of A (n, n), whose entries are known to within e (n, n)."""
    n = len(A)
    rest, bound, at = A, np.maximum(e, EPS * np.abs(A)), np.arange(n)
    deflated: list[tuple[Array, MatrixNullSpace, Array]] = []  # indices, null space, A_fo
    while len(rest):
        null = null_space(rest, bound)
        o, f = null.pivots, null.free
        if not len(f):
            break
        deflated.append((at, null, rest[np.ix_(f, o)]))
        size, A_fo = np.abs(null.B), rest[np.ix_(f, o)]
        bound = bound[np.ix_(o, o)] + size @ bound[np.ix_(f, o)] + EPS * size @ np.abs(A_fo)
        rest, at = rest[np.ix_(o, o)] - null.B @ A_fo, at[o]
    zeros = n - len(rest)
    values, vectors, known = np.zeros(n, complex), np.zeros((n, n), complex), np.ones(n, bool)
    if zeros:
        null = deflated[0][1]
        vectors[:, : len(null.free)] = null.vectors
    if len(rest):
        values[zeros:], right, known[zeros:] = _eigenvalues(rest, bound)
        vectors[np.ix_(at, np.arange(zeros, n))] = right
        for indices, null, A_fo in reversed(deflated):
            _lift(vectors[:, zeros:], values[zeros:], indices, null, A_fo)
    return Spectrum(values, vectors, known)


def _lift(vectors: Array, values: Array, indices: Array, null: MatrixNullSpace, A_fo: Array) -> None:
    """Lift eigenvectors of the deflated matrix by null vectors X: x + X c with c = A_fo x / lambda."""
    x = vectors[indices[null.pivots]]
    c = A_fo @ x / values
    vectors[indices[null.free]] = c
    vectors[indices[null.pivots]] = x + null.B @ c


def _eigenvalues(A: Array, e: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues (n,), right eigenvectors (n, n) and which values are known (n,) of a nonsingular A (n, n).

    Rayleigh quotients y^H A x / y^H x remove contributions of the largest values to the smallest. Where y^H x is zero
    within rounding, as for critical damping, the computed values are kept, with the error sqrt(d g) of double roots,
    (lambda - mean)^2 = (g/2)^2 + d g: g is the distance to the nearest value, d the first-order error.
    """
    found, left, right = eig(A, left=True, right=True)
    found, left, right = found.astype(complex), left.astype(complex), right.astype(complex)
    cosines = (left.conj() * right).sum(0)
    rounding = EPS * np.maximum((np.abs(left) * np.abs(right)).sum(0), EPS)
    cosines = np.where(np.abs(cosines) > rounding, cosines, rounding)
    error = (np.abs(left) * (e @ np.abs(right))).sum(0) / np.abs(cosines)
    single = (np.abs(cosines) > CERTAIN * rounding) & (CERTAIN * error < np.abs(found))
    values = np.where(single, (left.conj() * (A @ right)).sum(0) / cosines, found)
    size = np.abs(values)
    gap = np.abs(found[:, None] - found + np.diag(np.full(len(A), np.inf))).min(axis=1)
    error = np.where(single, error, np.minimum(error, np.sqrt(error * np.maximum(gap, EPS * size))))
    known = CERTAIN * error < size
    errors = np.where(known, error, 0.0) * (1 + 1j)
    for k in np.flatnonzero(single):
        partials = np.outer(left[:, k].conj() / cosines[k], right[:, k])  # of the value with respect to A
        errors[k] = complex((np.abs(partials.real) * e).sum(), (np.abs(partials.imag) * e).sum())
    values.real[np.abs(values.real) <= CERTAIN * np.maximum(errors.real, EPS * size)] = 0.0
    values.imag[np.abs(values.imag) <= CERTAIN * np.maximum(errors.imag, EPS * size)] = 0.0
    return values, right, known


class Curvature(NamedTuple):
    """Signs of the eigenvalues of a symmetric matrix H, by the law of inertia from D^-1 H D^-1, D^2 = diag(e/eps).

    This scaling gives all entries the same relative error, so that large entries do not hide small ones.

    Attributes:
        values: eigenvalues of the scaled matrix, ascending, (k,).
        vectors: D^-1 times its eigenvectors, (k, k).
        signs: -1, 1, or 0 if no digit is significant, (k,).
    """

    values: Array
    vectors: Array
    signs: Array

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int((self.signs < 0).sum())

    @property
    def flat(self) -> int:
        """Number of eigenvalues that are zero within rounding."""
        return int((self.signs == 0).sum())


def scale_of(e: Array) -> Array:
    """Return d (k,): d_i^2 is the magnitude of the terms of entry (i, i), given error bounds e (k, k); 1 if 0."""
    size = np.sqrt(e.diagonal() / EPS)
    return np.where(size > 0, size, 1.0)


def curvature(H: Array, e: Array) -> Curvature:
    """Return the signs of the symmetric part of H (k, k), whose entries are known to within e (k, k)."""
    if not len(H):
        return Curvature(np.empty(0), H, np.empty(0))
    d = scale_of(e)
    e = np.maximum(e, EPS * np.outer(d, d))  # rounding of the eigenvalue iteration
    values, X = np.linalg.eigh((H + H.T) / (2 * np.outer(d, d)))
    vectors, size = X / d[:, None], np.abs(X / d[:, None])
    known = np.abs(values) > CERTAIN * (size * (e @ size)).sum(0)
    return Curvature(values, vectors, np.where(known, np.sign(values), 0.0))
