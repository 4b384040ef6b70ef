"""Exact numbers for tableaus: rationals and one square root, from the strings printed in papers."""

import ast
import operator
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import isqrt, sqrt
from typing import Union


@dataclass(frozen=True)
class Surd:
    """The number ``a + b sqrt(d)`` with rational a, b and an integer d > 1 that is not a perfect square."""

    a: Fraction
    b: Fraction
    d: int

    def _coerce(self, other: "Number | int") -> "Surd":
        if not isinstance(other, Surd):
            return Surd(Fraction(other), Fraction(0), self.d)
        if other.d != self.d:
            raise ValueError(f"cannot mix sqrt({self.d}) and sqrt({other.d})")
        return other

    def _make(self, a: Fraction, b: Fraction) -> "Number":
        return Surd(a, b, self.d) if b else a

    def __add__(self, other: "Number | int") -> "Number":
        o = self._coerce(other)
        return self._make(self.a + o.a, self.b + o.b)

    def __mul__(self, other: "Number | int") -> "Number":
        o = self._coerce(other)
        return self._make(self.a * o.a + self.d * self.b * o.b, self.a * o.b + self.b * o.a)

    def __neg__(self) -> "Surd":
        return Surd(-self.a, -self.b, self.d)

    def __sub__(self, other: "Number | int") -> "Number":
        return self + (-self._coerce(other))

    def __rsub__(self, other: "Number | int") -> "Number":
        return -self + other

    def __truediv__(self, other: "Number | int") -> "Number":
        o = self._coerce(other)
        norm = o.a * o.a - o.d * o.b * o.b
        return self * Surd(o.a / norm, -o.b / norm, o.d)

    def __rtruediv__(self, other: "Number | int") -> "Number":
        return self._coerce(other) / self

    __radd__ = __add__
    __rmul__ = __mul__

    def __float__(self) -> float:
        return float(self.a) + float(self.b) * sqrt(self.d)

    def __str__(self) -> str:
        return f"{self.a} + {self.b}*sqrt({self.d})"


Number = Union[Fraction, Surd]  # noqa: UP007  (the forward reference above requires Union)

DECIMAL = re.compile(r"(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")  # short exponents: longer ones exhaust the memory

_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}


@cache  # tableaus repeat entries, and each is read twice: to check it, and to use it
def exact(text: str) -> Number:
    """Read ``"161/1024"``, ``"0.25"`` or ``"1/6 - sqrt(3)/108"`` without rounding.

    Raises:
        ValueError: for anything but numbers, + - * / and one square root of an integer, and for a number that is too
            large or too small for double precision.
    """
    try:
        value = _evaluate(ast.parse(text.strip(), mode="eval").body, text.strip())
        rounded = float(value)
    except (SyntaxError, ZeroDivisionError):
        raise ValueError(f"not an exact number: {text!r:.60}") from None
    except (RecursionError, MemoryError):  # nested brackets exhaust the parser
        raise ValueError(f"too many nested brackets: {text!r:.60}") from None
    except OverflowError:
        raise ValueError(f"outside the range of double precision: {text!r:.60}") from None
    if not rounded and value:
        raise ValueError(f"outside the range of double precision: {text!r:.60}")
    return value


def _evaluate(node: ast.expr, text: str) -> Number:
    match node:
        case ast.Constant():
            digits = ast.get_source_segment(text, node) or ""
            if not DECIMAL.fullmatch(digits):
                raise ValueError(f"not a number: {digits!r:.60}")
            return Fraction(digits)
        case ast.UnaryOp(op=ast.USub()):
            return -_evaluate(node.operand, text)
        case ast.BinOp() if type(node.op) in _OPERATORS:
            return _OPERATORS[type(node.op)](_evaluate(node.left, text), _evaluate(node.right, text))
        case ast.Call(func=ast.Name(id="sqrt"), args=[ast.Constant(value=int(d))]) if isqrt(d) ** 2 != d:
            return Surd(Fraction(0), Fraction(1), d)
    raise ValueError(f"not an exact number: {text!r}")


def exact_inverse(matrix: list[list[Number]]) -> list[list[Number]]:
    """Return the inverse of a square matrix by elimination.

    Raises:
        ZeroDivisionError: if it is singular.
    """
    n = len(matrix)
    rows = [[*row, *(Fraction(int(i == j)) for j in range(n))] for i, row in enumerate(matrix)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if rows[i][k]), k)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(n):
            factor = rows[i][k]
            if i != k and factor:
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[n:] for row in rows]


def row(text: str) -> tuple[str, ...]:
    """Split a row of numbers without spaces inside them, ``"1/6 2/3 1/6"``."""
    return tuple(text.split())


def rows(text: str) -> tuple[tuple[str, ...], ...]:
    """Split a table as printed on a page, one row per line."""
    return tuple(row(line) for line in text.strip().splitlines())
