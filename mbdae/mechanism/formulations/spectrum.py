"""Eigenvalues of a matrix whose entries are known up to their own rounding.

Beside a matrix A goes e, |dA| <= e entry by entry: eps times the sizes of the terms that were summed. The linearised
motion [0 1; -M^-1 K  -M^-1 D] has ones beside the squares of frequencies, so no norm says which of its numbers are
zeros. Here a number is one where none of its digits is known, |a| <= 100 e, whatever the units and the other motions.

The rank comes from elimination in the order of certainty, |a|/e, which no scaling of rows and columns changes, with a
running error bound. Null vectors X = [1 on the free columns f; B on the others o] are divided out along unit vectors,

    A <- A_oo - B A_fo,   e <- e_oo + |B| e_fo + eps |B| |A_fo|,

again and again, since zeros come in chains (rigid motions and their speeds). An orthonormal complement would mix the
largest frequencies into the smallest ones. Source of the bound: Wilkinson, Rounding Errors in Algebraic Processes
(1963); of the eigenvalues' errors: Stewart, Sun, Matrix Perturbation Theory (1990), theorem IV.2.3.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eig, solve_triangular

from ...system import Array

EPS = float(np.finfo(float).eps)
CERTAIN = 100.0  # of the rounding of a number: what is known to be none


class Null(NamedTuple):
    """The null space of a matrix, x_o = B x_f.

    Attributes:
        rows: in the order of their pivots, those without one last.
        others: columns o with a pivot, (r,).
        free: columns f without one, (n - r,).
        B: (r, n - r).
    """

    rows: Array
    others: Array
    free: Array
    B: Array

    @property
    def vectors(self) -> Array:
        """The null vectors, (n, n - r)."""
        out = np.zeros((len(self.others) + len(self.free), len(self.free)))
        out[self.free], out[self.others] = np.eye(len(self.free)), self.B
        return out


def null_space(A: Array, e: Array) -> Null:
    """The null space of A (m, n), of which each entry is known to e (m, n)."""
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
        doubt = (e[r + 1 :, r] + np.abs(factor) * e[r, r]) / abs(a[r, r])
        e[r + 1 :, r + 1 :] += size * e[r, r + 1 :] + (doubt[:, None] + EPS * size) * np.abs(row)
        a[r + 1 :, r + 1 :] -= factor[:, None] * row
        a[r + 1 :, r] = 0.0
        r += 1
    B = -solve_triangular(a[:r, :r], a[:r, r:]) if r else np.empty((0, n))
    return Null(rows, columns[:r], columns[r:], B)


class Spectrum(NamedTuple):
    """Eigenvalues of A (n, n), first those that are exactly 0.

    Attributes:
        values: (n,), complex.
        vectors: right eigenvectors as columns, (n, n), complex; 0 for zeros of a chain that have none of their own.
        noise: how closely each value is known, (n,): |y|^T e |x| / |y^H x|, y and x the left and right vectors.
    """

    values: Array
    vectors: Array
    noise: Array

    @property
    def growing(self) -> Array:
        """Which values have a positive real part that is known to be one, (n,)."""
        return self.values.real > CERTAIN * self.noise

    def sorted(self, order: Array) -> "Spectrum":
        """The same in another order."""
        return Spectrum(self.values[order], self.vectors[:, order], self.noise[order])


def spectrum(A: Array, e: Array) -> Spectrum:
    """Eigenvalues and vectors of A (n, n), of which each entry is known to e (n, n)."""
    n = len(A)
    rest, doubt, at = A, np.maximum(e, EPS * np.abs(A)), np.arange(n)
    lifts: list[tuple[Array, Null, Array]] = []  # what was divided out: the places, the null space, and A_fo
    while len(rest):
        null = null_space(rest, doubt)
        o, f = null.others, null.free
        if not len(f):
            break
        lifts.append((at, null, rest[np.ix_(f, o)]))
        size, across = np.abs(null.B), rest[np.ix_(f, o)]
        doubt = doubt[np.ix_(o, o)] + size @ doubt[np.ix_(f, o)] + EPS * size @ np.abs(across)
        rest, at = rest[np.ix_(o, o)] - null.B @ across, at[o]
    zeros = n - len(rest)
    values, vectors, noise = np.zeros(n, complex), np.zeros((n, n), complex), np.zeros(n)
    if zeros:
        null = lifts[0][1]
        vectors[:, : len(null.free)] = null.vectors
    if len(rest):
        values[zeros:], right, noise[zeros:] = _eigenvalues(rest, doubt)
        vectors[np.ix_(at, np.arange(zeros, n))] = right
        for places, null, across in reversed(lifts):
            _lift(vectors[:, zeros:], values[zeros:], places, null, across)
    return Spectrum(values, vectors, noise)


def _lift(vectors: Array, values: Array, places: Array, null: Null, across: Array) -> None:
    """Take eigenvectors of a quotient by null vectors X back: x + X c with c = A_fo x / lambda."""
    x = vectors[places[null.others]]
    c = across @ x / values
    vectors[places[null.free]] = c
    vectors[places[null.others]] = x + null.B @ c


def _eigenvalues(A: Array, e: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues (n,), right vectors (n, n) and noise (n,) of a regular A (n, n).

    Rayleigh quotients y^H A x / y^H x take away what the iteration mixed of the largest values into the smallest.
    """
    values, left, right = eig(A, left=True, right=True)
    left, right = left.astype(complex), right.astype(complex)
    angles = (left.conj() * right).sum(0)
    regular = angles != 0
    mean = np.divide((left.conj() * (A @ right)).sum(0), angles, out=values.astype(angles.dtype), where=regular)
    noise = np.full(len(A), np.inf)
    np.divide((np.abs(left) * (e @ np.abs(right))).sum(0), np.abs(angles), out=noise, where=regular)
    return mean + 0.0, right, noise  # and no -0.0


class Curvature(NamedTuple):
    """Signs of the eigenvalues of a symmetric matrix H, by Sylvester's law from D^-1 H D^-1, D^2 = diag(e/eps).

    Scaled so that all entries are known alike, the largest of them hides none of the others.

    Attributes:
        values: eigenvalues of the scaled matrix, rising, (k,).
        vectors: D^-1 times its eigenvectors, (k, k).
        signs: -1, 0 where no digit is known, or 1, (k,).
    """

    values: Array
    vectors: Array
    signs: Array

    @property
    def negative(self) -> int:
        """The number of eigenvalues that are negative."""
        return int((self.signs < 0).sum())

    @property
    def flat(self) -> int:
        """The number of eigenvalues that are zero as far as is known."""
        return int((self.signs == 0).sum())


def scale_of(e: Array) -> Array:
    """Return d (k,) with d_i^2 the size of the terms of the entry (i, i) of a matrix known to e (k, k); 1 for none."""
    size = np.sqrt(e.diagonal() / EPS)
    return np.where(size > 0, size, 1.0)


def curvature(H: Array, e: Array) -> Curvature:
    """The signs of the symmetric part of H (k, k), of which each entry is known to e (k, k)."""
    if not len(H):
        return Curvature(np.empty(0), H, np.empty(0))
    d = scale_of(e)
    e = np.maximum(e, EPS * np.outer(d, d))  # of the iteration for eigenvalues
    values, X = np.linalg.eigh((H + H.T) / (2 * np.outer(d, d)))
    vectors, size = X / d[:, None], np.abs(X / d[:, None])
    known = np.abs(values) > CERTAIN * (size * (e @ size)).sum(0)
    return Curvature(values, vectors, np.where(known, np.sign(values), 0.0))
