"""Simplifying assumptions B, C, D of a tableau, from which most of its order conditions follow."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from ...tolerances import PUBLISHED_DECIMALS
from ..exact_numbers import Number
from ..runge_kutta import RungeKutta
from ..tableau import Row


@dataclass(frozen=True)
class Assumptions:
    """Largest k up to which each assumption holds; C and Chat are checked up to the order of the method, at most 2 n.

    Attributes:
        B: sum_i b_i c_i^(k-1) = 1/k for k = 1..B.
        C: for each row i, sum_j a_ij c_j^(k-1) = c_i^k / k for k = 1..C_i.
        Chat: for each row i, sum_j ahat_ij c_j^(k-1) = chat_i^k / k for k = 1..Chat_i.
        D: sum_i b_i c_i^(k-1) a_ij = b_j (1 - c_j^k) / k for all j and k = 1..D.
    """

    B: int
    C: tuple[int, ...]
    Chat: tuple[int, ...]
    D: int

    @property
    def implicit(self) -> str:
        """``"B(3) C(2) D(1)"``, as in the literature on implicit methods; the first row is the explicit stage."""
        return f"B({self.B}) C({min(self.C[1:])}) D({self.D})"

    def __str__(self) -> str:
        C, Chat = (" ".join(map(str, rows)) for rows in (self.C, self.Chat))
        return f"B({self.B}), D({self.D}), C on rows: {C}, Chat on rows: {Chat}"


def assumptions(tableau: RungeKutta) -> Assumptions:
    """Find the simplifying assumptions that a tableau satisfies; rounded coefficients satisfy them to rounding.

    Args:
        tableau: the method.

    Returns:
        The largest k of each; for rows at most the claimed order, since a row of zeros satisfies C(k) for all k.
    """
    tolerance = PUBLISHED_DECIMALS if tableau.rounded else 0.0
    A, Ahat, b = tableau.exact_A, tableau.exact_Ahat, tableau.exact_b
    zero: Number = Fraction(0)
    c, chat = ([sum(row, start=zero) for row in M] for M in (A, Ahat))

    def quadrature(row: Row, node: Number) -> Callable[[int], bool]:
        def holds(k: int) -> bool:
            powers = (x * _power(y, k - 1) for x, y in zip(row, c, strict=True))
            return _vanishes(sum(powers, start=zero) - _power(node, k) / k, tolerance)

        return holds

    def transposed(k: int) -> bool:
        weights = [w * _power(x, k - 1) for w, x in zip(b, c, strict=True)]
        left = [sum((w * row[j] for w, row in zip(weights, A, strict=True)), start=zero) for j in range(len(b))]
        right = [w * (1 - _power(x, k)) / k for w, x in zip(b, c, strict=True)]
        return all(_vanishes(x - y, tolerance) for x, y in zip(left, right, strict=True))

    def largest(holds: Callable[[int], bool], bound: int) -> int:
        return next((k for k in range(1, bound + 1) if not holds(k)), bound + 1) - 1

    bound = 2 * len(b)  # n nodes do not integrate all polynomials of degree 2 n exactly
    C, Chat = (
        tuple(largest(quadrature(row, node), min(bound, tableau.order)) for row, node in zip(M, nodes, strict=True))
        for M, nodes in ((A, c), (Ahat, chat))
    )
    return Assumptions(largest(quadrature(b, Fraction(1)), bound), C, Chat, largest(transposed, bound))


def _power(x: Number, k: int) -> Number:
    value: Number = Fraction(1)
    for _ in range(k):
        value = value * x
    return value


def _vanishes(x: Number, tolerance: float) -> bool:
    return not x or abs(float(x)) <= tolerance
