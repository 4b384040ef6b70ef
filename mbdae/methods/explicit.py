"""Explicit Runge-Kutta methods for ordinary differential equations as data: a baseline for half-explicit methods.

They integrate the accelerations of a mechanism (formulation index 1), in the tangent coordinates of each step.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..system import State, Step, System
from .controller import Control
from .exact_numbers import exact
from .half_explicit_step import half_explicit_step
from .tableau import ButcherArrays, Row, Text


@dataclass(frozen=True)
class ExplicitMethod:
    """Coefficients of an explicit Runge-Kutta method for y' = F(t, y), controlled by two embedded formulas.

        Y_i = y_0 + h sum_{j<i} a_ij F(t_j, Y_j),   y_1 = y_0 + h sum b_i F_i

    A last stage at y_1 is added: it is the first stage of the next step, and provides the multipliers at y_1. The error
    estimate is

        err_1^2 / (err_1^2 + 0.01 err_2^2)^(1/2),   of size h^(2 (p_1 + 1) - (p_2 + 1))

    Args:
        name: name typed by the user.
        title: one line for a list of methods.
        reference: where the coefficients were published.
        A: rows of the coefficients a_ij as text, lower triangle.
        b: weights as text.
        order: claimed order.
        e_embedded: the embedded formula's weights minus b, as text.
        order_embedded: its order p_1.
        b_companion: weights of a second embedded formula.
        order_companion: its order p_2.
        control: parameters of the step-size control.
    """

    name: str
    title: str
    reference: str
    A: tuple[Text, ...] = field(repr=False)
    b: Text = field(repr=False)
    order: int
    e_embedded: Text = field(repr=False)
    order_embedded: int
    b_companion: Text = field(repr=False)
    order_companion: int
    control: Control

    family = "explicit"
    excludes: ClassVar[Mapping[str, str]] = {}
    in_core = True  # the compiled core takes its steps
    blend = 2.0
    noise = 0.0
    explicit_first = True
    project_embedded = False
    rounded = True

    @property
    def order_linear(self) -> int:
        """Order for mechanisms, equal to `order`."""
        return self.order

    @property
    def order_own(self) -> int:
        """Order of z at y_1, from the hidden constraint, equal to `order`."""
        return self.order

    @property
    def error_power(self) -> int:
        """Power of h in the error estimate."""
        return 2 * (self.order_embedded + 1) - (self.order_companion + 1)

    @property
    def solves(self) -> int:
        """Evaluations per step; the one at y_1 is reused by the next."""
        return len(self.A)

    @cached_property
    def exact_A(self) -> list[Row]:
        """Exact A including the last stage at y_1, (n, n)."""
        return [_row(r, len(self.A) + 1) for r in (*self.A, self.b)]

    @cached_property
    def exact_Ahat(self) -> list[Row]:
        """Identity matrix, (n, n): stages have no constraint."""
        n = len(self.A) + 1
        return [_row(("0",) * i + ("1",), n) for i in range(n)]

    @cached_property
    def exact_b(self) -> Row:
        """Exact weights, (n,)."""
        return self.exact_A[-1]

    @cached_property
    def exact_embedded(self) -> list[Row]:
        """Exact weights of both embedded formulas, (n,) each."""
        n = len(self.A) + 1
        embedded = [b + e for b, e in zip(self.exact_b, _row(self.e_embedded, n), strict=True)]
        return [embedded, _row(self.b_companion, n)]

    @cached_property
    def arrays(self) -> ButcherArrays:
        """The coefficients in double precision, rounded once."""
        A, b = np.array(self.exact_A, float), np.array(self.exact_b, float)
        c = np.array([sum(r, start=exact("0")) for r in self.exact_A], float)
        e = [[w - b for w, b in zip(row, self.exact_b, strict=True)] for row in self.exact_embedded]
        return ButcherArrays(A, np.eye(len(b)), b, c, c, np.array(e, float))

    def compiled(self, native: object) -> Any:
        """Return the method for the compiled core."""
        return self.arrays.compiled(
            native, explicit_first=True, project_embedded=False, doubling_order=0, noise=self.noise
        )

    def step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step, see `mbdae.methods.half_explicit_step.half_explicit_step`, with unconstrained stages."""
        return system.compiled_step(self, t, h, state) or half_explicit_step(system, self, t, h, state)

    controlled_step = step

    def min_growth(self, ny: int) -> float:
        """Return 1: see `mbdae.methods.tableau.Tableau.min_growth`."""
        return 1.0


def _row(text: Text, n: int) -> Row:
    return [exact(x) for x in text] + [exact("0")] * (n - len(text))
