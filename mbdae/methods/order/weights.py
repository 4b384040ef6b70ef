"""Elementary weights of a tableau for a tree, in exact arithmetic.

Vectors over the stages are integers over one common denominator; over Q(sqrt d) a vector a + b sqrt(d) consists
of the entries of a, followed by those of b. Each subtree is evaluated once.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import cache
from math import gcd, lcm, prod
from typing import NamedTuple

from ..exact_numbers import Number, Surd, exact_inverse
from ..runge_kutta import RungeKutta
from ..tableau import Row
from .trees import RootedTree

Weight = Callable[[RootedTree], Number]


class Vector(NamedTuple):
    """An exact vector ``numbers / denominator``."""

    numbers: list[int]
    denominator: int


class Weights:
    """Elementary weights of a tableau with n stages (Hairer, Lubich, Roche 1989, chapter 5; Murua 1997).

        phi_i(tau) = 1,  phi_i([t_1.., u_1..]_y) = prod_k (A phi(t_k))_i prod_l psi_i(u_l)
        psi(u) = W prod_k (Ahat phi(t_k))  for u = [t_1..]_z,  W the inverse of Ahat

    An explicit first stage has psi_1 = 0 (z_0 is exact): its row of Ahat is replaced by e_1 before the inversion.

    Args:
        tableau: the coefficients.

    Attributes:
        W: the inverse above, (n, n).
    """

    def __init__(self, tableau: RungeKutta) -> None:
        A, Ahat = tableau.exact_A, tableau.exact_Ahat
        self.n = len(A)
        self.d = next((x.d for r in (*A, *Ahat, tableau.exact_b) for x in r if isinstance(x, Surd)), 0)
        first: Row = [Fraction(int(not j)) for j in range(self.n)]
        self.W = exact_inverse([first, *Ahat[1:]] if tableau.explicit_first else Ahat)
        self._A, self._Ahat, self._W = (self._matrix(M) for M in (A, Ahat, self.W))
        self._ones = Vector([1] * self.n + [0] * (self.n if self.d else 0), 1)
        self._phi: dict[RootedTree, Vector] = {}
        self._A_phi: dict[RootedTree, Vector] = {}
        self._Ahat_phi: dict[RootedTree, Vector] = {}

    def stages(self, tree: RootedTree) -> Vector:
        """Return phi(t) of a meagre tree or psi(u) of a fat one at the n stages."""
        if tree not in self._phi:
            if tree.fat:
                factors = [self._memo(self._Ahat_phi, self._Ahat, t) for t in tree.sons_y]
                self._phi[tree] = self._apply(self._W, self._product(factors))
            else:
                factors = [self._memo(self._A_phi, self._A, t) for t in tree.sons_y]
                self._phi[tree] = self._product(factors + [self.stages(u) for u in tree.sons_z])
        return self._phi[tree]

    def sums(self, row: Row) -> Weight:
        """Return the function tree -> sum_i row_i phi_i, or of psi_i for a fat tree; the row is padded with zeros."""
        matrix = self._matrix([[*row, *[Fraction(0)] * (self.n - len(row))]])
        return cache(lambda tree: self._number(self._apply(matrix, self.stages(tree)), 0))

    def last(self, tree: RootedTree) -> Number:
        """Return phi or psi at the last stage."""
        return self._number(self.stages(tree), self.n - 1)

    def sums_at_end(self, b: Row) -> Weight:
        """Return the function tree -> psi of z_1 = R(infinity) z_0 + sum_ij b_i w_ij Z_j.

        It is the weight of a stage whose row of Ahat is b.
        """
        columns = zip(*self.W, strict=True)
        return self.sums([sum((x * w for x, w in zip(b, col, strict=True)), start=Fraction(0)) for col in columns])

    def _memo(self, memo: dict[RootedTree, Vector], matrix: "_Matrix", tree: RootedTree) -> Vector:
        if tree not in memo:
            memo[tree] = self._apply(matrix, self.stages(tree))
        return memo[tree]

    def _matrix(self, M: list[Row]) -> "_Matrix":
        """Return the matrix that represents M on such vectors, as integers over one denominator."""
        rational = self._rational(M)
        den = lcm(*(x.denominator for r in rational for x in r))
        sparse = [[(j, int(x * den)) for j, x in enumerate(r) if x] for r in rational]
        return _Matrix(sparse, den)

    def _rational(self, M: list[Row]) -> list[list[Fraction]]:
        """Return a matrix of fractions; a + b sqrt(d) becomes [[a, d b], [b, a]], see the module."""
        a = [[x.a if isinstance(x, Surd) else x for x in r] for r in M]
        if not self.d:
            return a
        b = [[x.b if isinstance(x, Surd) else Fraction(0) for x in r] for r in M]
        upper = [[*ra, *(self.d * x for x in rb)] for ra, rb in zip(a, b, strict=True)]
        return upper + [[*rb, *ra] for ra, rb in zip(a, b, strict=True)]

    def _apply(self, matrix: "_Matrix", v: Vector) -> Vector:
        x = v.numbers
        return _reduced([sum([a * x[j] for j, a in row]) for row in matrix.rows], matrix.denominator * v.denominator)

    def _product(self, factors: list[Vector]) -> Vector:
        x, n = self._ones.numbers, self.n
        for factor in factors:
            y = factor.numbers
            if self.d:
                first = [x[i] * y[i] + self.d * x[n + i] * y[n + i] for i in range(n)]
                x = first + [x[i] * y[n + i] + x[n + i] * y[i] for i in range(n)]
            else:
                x = [a * b for a, b in zip(x, y, strict=True)]
        return _reduced(x, prod(f.denominator for f in factors))

    def _number(self, v: Vector, i: int) -> Number:
        half = len(v.numbers) // 2
        a = Fraction(v.numbers[i], v.denominator)
        b = Fraction(v.numbers[half + i], v.denominator) if self.d else Fraction(0)
        return Surd(a, b, self.d) if b else a


class _Matrix(NamedTuple):
    rows: list[list[tuple[int, int]]]
    denominator: int


def _reduced(numbers: list[int], denominator: int) -> Vector:
    common = gcd(denominator, *numbers)
    return Vector([x // common for x in numbers], denominator // common)
