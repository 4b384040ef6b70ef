"""Values of coordinates as expressions of the state, in files: ``"cos(2*q.stance) * v.stance"``.

Allowed are numbers, + - * / **, brackets, pi, t, functions of one argument, states s.<state>, and coordinates
q.<joint>, v.<joint> (q.<joint>.x for joints of several coordinates) of joints with nq = nv. Derivatives are complex
steps, exact to rounding: f_x = Im f(x + i h)/h.
"""

import ast
import cmath
import operator
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError, MbdaeError, StepError, UnknownNameError
from ...system import Array
from ...tolerances import TINY
from ..tree.coordinate_units import component_suffixes
from ..tree.frames import find_joint

if TYPE_CHECKING:
    from ..mechanism import Mechanism

FUNCTIONS: dict[str, Callable[[complex], complex]] = {
    name: getattr(cmath, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sqrt", "exp", "log")
}
OPERATORS: dict[type, Callable[..., complex]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
MAX_LENGTH = 1000  # characters of an expression


def state_columns(mech: "Mechanism") -> dict[str, tuple[int, int]]:
    """Return the indices in y and in its tangent of the coordinates that expressions can use, by name."""
    out: dict[str, tuple[int, int]] = {}
    for name in mech.joint_names:
        joint, suffixes = find_joint(mech.model, name), component_suffixes(mech, name)
        if joint.nq == joint.nv and mech.joint_kind(name) != "Spherical":
            for i, suffix in enumerate(suffixes[0]):
                out[f"q.{name}{suffix}"] = joint.idx_q + i, joint.idx_v + i
        for i, suffix in enumerate(suffixes[1]):
            out[f"v.{name}{suffix}"] = mech.nq + joint.idx_v + i, mech.nv + joint.idx_v + i
    for i, name in enumerate(mech.states):
        out[f"s.{name}"] = mech.nq + mech.nv + i, 2 * mech.nv + i
    return out


class Expression:
    """An expression of t and coordinates.

    Args:
        text: the expression.
        columns: indices in y and in its tangent of the coordinates, by name.

    Attributes:
        names: names of the coordinates in it.

    Raises:
        InputError: for invalid syntax.
        UnknownNameError: for an unknown coordinate or function, with the valid names.
    """

    def __init__(self, text: str | float, columns: Mapping[str, tuple[int, int]]) -> None:
        self.text, self.columns, self.names = str(text), columns, dict[str, None]()
        try:
            if len(self.text) > MAX_LENGTH:
                raise ValueError
            self._tree = _parsed(self.text.strip())
            self._check(self._tree)
        except MbdaeError:
            raise
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise InputError(
                f"expected numbers, coordinates, + - * / **, brackets and functions, got {self.text!r:.80}"
            ) from None

    def _check(self, node: ast.expr) -> None:
        match node:
            case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
                return
            case ast.Name(id="pi" | "t"):
                return
            case ast.Attribute() | ast.Name():
                name = ast.unparse(node)
                if name not in self.columns:
                    raise UnknownNameError("coordinate", name, ("pi", "t", *self.columns))
                self.names[name] = None
                return
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
                if name not in FUNCTIONS:
                    raise UnknownNameError("function", name, FUNCTIONS)
                self._check(argument)
                return
            case ast.UnaryOp() if type(node.op) in OPERATORS:
                self._check(node.operand)
                return
            case ast.BinOp() if type(node.op) in OPERATORS:
                self._check(node.left)
                self._check(node.right)
                return
        raise ValueError

    def value(self, t: float, y: Array) -> float:
        """Return the value at a point y (n,).

        Raises:
            StepError: if it is not a finite real number.
        """
        found = self._evaluated(t, self._coordinates(y))
        if not np.isfinite(found.real) or found.imag:
            raise StepError("nonfinite", f"{self.text!r} is {found:.6g} at t = {t:.17g}")
        return found.real

    def partials(self, t: float, y: Array, ny: int) -> Array:
        """Return the derivatives with respect to y in its tangent and to t, (ny + 1,)."""
        out, values = np.zeros(ny + 1), self._coordinates(y)
        for name, x in values.items():
            out[self.columns[name][1]] = self._evaluated(t, {**values, name: x + 1j * TINY}).imag / TINY
        out[-1] = self._evaluated(t + 1j * TINY, values).imag / TINY
        return out

    def _coordinates(self, y: Array) -> dict[str, complex]:
        return {name: complex(y[self.columns[name][0]]) for name in self.names}

    def _evaluated(self, t: complex, values: Mapping[str, complex]) -> complex:
        try:
            return complex(_evaluate(self._tree, {**values, "t": t, "pi": cmath.pi}))
        except (ArithmeticError, ValueError) as e:
            raise StepError("nonfinite", f"{self.text!r} cannot be computed at t = {t.real:.17g}: {e}") from None


@lru_cache(256)
def _parsed(text: str) -> ast.expr:
    """Return the syntax tree of an expression; cached, since variants of a mechanism share expressions."""
    return ast.parse(text, mode="eval").body


def _evaluate(node: ast.expr, values: Mapping[str, complex]) -> complex:
    match node:
        case ast.Constant():
            return complex(node.value)  # type: ignore[arg-type]
        case ast.Call(func=ast.Name(id=name), args=[argument]):
            return FUNCTIONS[name](_evaluate(argument, values))
        case ast.UnaryOp():
            return OPERATORS[type(node.op)](_evaluate(node.operand, values))
        case ast.BinOp():
            return OPERATORS[type(node.op)](_evaluate(node.left, values), _evaluate(node.right, values))
    return values[ast.unparse(node)]
