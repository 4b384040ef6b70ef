"""Order conditions of compositions of a symmetric method of order 2, in exact arithmetic.

A step of size h of the basic method is exp(h X_1 + h^3 X_3 + h^5 X_5 + ...) with vector fields X_k (Hairer, Lubich,
Wanner, Geometric Numerical Integration, section IX.2). Steps gamma_i h give the product of the exponentials of
sum_k gamma_i^k h^k X_k: a series over words in the letters 1, 3, 5, ..., whose sum is the power of h. The
composition has order p if and only if, up to the power h^p, this series is that of exp(h X_1): 1/k! for the word 1...1
of k letters, 0 for all others. For a symmetric composition, the conditions of even powers follow. Sums of odd powers of
gamma_i are the conditions of words with one letter, which are insufficient above order 4.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from fractions import Fraction
from math import factorial

from ...data_types import JsonObject
from ...tolerances import PUBLISHED_DECIMALS
from ..exact_numbers import Number
from ..variational import Composition

Word = tuple[int, ...]
Series = dict[Word, Number]


@dataclass(frozen=True)
class CompositionReport:
    """Result of the order conditions of a composition.

    Attributes:
        name: name of the method.
        claimed: the claimed order.
        order: the order found, at most one above the claim.
        symmetric: whether the weights are a palindrome.
        conditions: the number of words that agree up to the order found.
        residual: the largest difference among them, below `PUBLISHED_DECIMALS`.
        failure: the first word that differs, with its coefficient; "" if none does.
    """

    name: str
    claimed: int
    order: int
    symmetric: bool
    conditions: int
    residual: float
    failure: str

    @property
    def holds(self) -> bool:
        """Whether the claim is reached."""
        return self.symmetric and self.order >= self.claimed

    def __str__(self) -> str:
        size = f", to {self.residual:.0e}" if self.residual else ""
        then = f"; then {self.failure}" if self.failure else "; nothing higher was tried"
        return (
            f"{self.name}: its claims {'hold' if self.holds else 'DO NOT HOLD'}\n"
            f"  q, v                claimed {self.claimed}, found {self.order} ({self.conditions} words{size}){then}\n"
            f"  weights             {'symmetric' if self.symmetric else 'NOT SYMMETRIC'}"
        )

    def to_dict(self) -> JsonObject:
        """Return the report as JSON data."""
        return asdict(self) | {"holds": self.holds}


def check_composition(method: Composition) -> CompositionReport:
    """Compare the series of a composition with that of the exact flow, up to one order above its claim."""
    weights, highest = method.exact_weights, method.order + 1
    series = _exponential(weights[0], highest)
    for gamma in weights[1:]:
        series = _product(series, _exponential(gamma, highest), highest)
    conditions, residual, symmetric = 0, 0.0, weights == weights[::-1]
    for order in range(1, highest + 1):
        differences = {word: series[word] - _exact(word) for word in _words(order)}
        for word, difference in differences.items():
            if abs(float(difference)) > PUBLISHED_DECIMALS:
                text = f"the word {' '.join(map(str, word))} has {float(series[word]):.6g}, not {_exact(word)}"
                return CompositionReport(method.name, method.order, order - 1, symmetric, conditions, residual, text)
        conditions += len(differences)
        residual = max(residual, *(abs(float(x)) for x in differences.values()))
    return CompositionReport(method.name, method.order, highest, symmetric, conditions, residual, "")


def _words(power: int) -> Iterator[Word]:
    """Yield the words of odd letters whose sum is a given power."""
    if not power:
        yield ()
    for letter in range(1, power + 1, 2):
        yield from ((letter, *rest) for rest in _words(power - letter))


def _exact(word: Word) -> Fraction:
    return Fraction(int(set(word) <= {1}), factorial(len(word)))


def _exponential(gamma: Number, highest: int) -> Series:
    """Return the series of exp(sum_k gamma^k h^k X_k), up to the highest power."""
    powers: list[Number] = [Fraction(1)]
    for _ in range(highest):
        powers.append(powers[-1] * gamma)
    return {word: powers[n] * Fraction(1, factorial(len(word))) for n in range(highest + 1) for word in _words(n)}


def _product(a: Series, b: Series, highest: int) -> Series:
    return {
        word: sum((a[word[:i]] * b[word[i:]] for i in range(len(word) + 1)), start=Fraction(0))
        for n in range(highest + 1)
        for word in _words(n)
    }
