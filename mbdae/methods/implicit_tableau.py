"""An implicit Runge-Kutta method as data: exact coefficients, claims, and derived properties."""

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import ClassVar

import numpy as np

from ..errors import InputError
from ..system import State, Step, System
from .coupled_method import CoupledMethod
from .exact_numbers import Number, exact, exact_inverse
from .stage_arrays import StageArrays, stage_arrays
from .tableau import Row, Text

ZERO = Fraction(0)


@dataclass(frozen=True)
class ImplicitTableau(CoupledMethod):
    """Coefficients of an implicit Runge-Kutta method for y' = f(t, y, z), 0 = g(t, y), with a nonsingular A.

    All stages Y_i = y_0 + h sum_j a_ij f(t_j, Y_j, Z_j) satisfy 0 = g(t_i, Y_i); then, with omega = A^-1,

        y_1 = y_0 + h sum_i b_i f(t_i, Y_i, Z_i),   z_1 = R(infinity) z_0 + sum_ij b_i omega_ij Z_j.

    The theory requires |R(infinity)| < 1: otherwise errors of z are not damped (Hairer, Lubich, Roche, Lecture Notes in
    Mathematics 1409 (1989), chapter 4). The step size is fixed: there is no error estimate.

    Args:
        name: name typed by the user, for instance ``"gauss2"``.
        title: one line for a list of methods.
        reference: where the coefficients were published.
        A: rows of the coefficients a_ij as text, (s, s).
        b: weights as text, (s,).
        order: claimed order of y for general f.
        order_own: claimed order of the z of the method; 0: it does not converge.

    Raises:
        InputError: for a singular or empty A, rows of different lengths, or entries that are not exact numbers.
    """

    name: str
    title: str
    reference: str
    A: tuple[Text, ...] = field(repr=False)
    b: Text = field(repr=False)
    order: int
    order_own: int

    family = "implicit"
    order_embedded = 0
    error_power = 0
    project_embedded = False
    rounded = False
    b_embedded: ClassVar[Text] = ()
    b_companion: ClassVar[Text] = ()

    def __post_init__(self) -> None:
        s = len(self.b)
        if not s or len(self.A) != s or any(len(row) != s for row in self.A):
            raise InputError(f"tableau {self.name!r}: A has {s} rows of {s} numbers, as many as b, at least one")
        try:
            _ = self.R_infinity
        except ZeroDivisionError:
            reason = "A is singular: its inverse determines z from the stages"
            raise InputError(f"tableau {self.name!r}: {reason}") from None
        except ValueError as e:
            raise InputError(f"tableau {self.name!r}: {e}") from None

    @property
    def stages(self) -> int:  # type: ignore[override]
        """Number of stages, s."""
        return len(self.b)

    @property
    def order_linear(self) -> int:
        """Order of y when f is linear in z, equal to `order`."""
        return self.order

    @cached_property
    def _square(self) -> list[Row]:
        return [[exact(x) for x in row] for row in self.A]

    @cached_property
    def exact_A(self) -> list[Row]:  # type: ignore[override]
        """Exact A with an additional zero row and column for the explicit stage, (s + 1, s + 1)."""
        return [[ZERO] * (self.stages + 1), *([ZERO, *row] for row in self._square)]

    @cached_property
    def exact_b(self) -> Row:
        """Exact weights, after a zero for the explicit stage, (s + 1,)."""
        return [ZERO, *map(exact, self.b)]

    @cached_property
    def R_infinity(self) -> Number:
        """R(infinity) = 1 - sum_ij b_i omega_ij, exact."""
        omega = exact_inverse(self._square)
        weights = (b * x for b, row in zip(self.exact_b[1:], omega, strict=True) for x in row)
        return 1 - sum(weights, start=ZERO)

    @cached_property
    def arrays(self) -> StageArrays:  # type: ignore[override]
        """The coefficients in double precision."""
        c = [float(sum(row, start=ZERO)) for row in self._square]
        A, b = np.array([[float(x) for x in row] for row in self._square]), [float(x) for x in self.exact_b[1:]]
        return stage_arrays(np.array(c), A, np.array(b), float(self.R_infinity))

    def controlled_step(self, system: System, t: float, h: float, state: State) -> Step:
        """Reject the call: the method has no error estimate.

        Raises:
            InputError: always.
        """
        raise InputError(f"method {self.name!r} has no error estimate: give step")
