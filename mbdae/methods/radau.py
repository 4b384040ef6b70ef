"""Radau IIA methods: implicit, stiffly accurate, of order 2s - 1 in y and s in the multipliers of the method.

This follows from the assumptions B(2s - 1), C(s), D(s - 1) (Hairer, Lubich, Roche, Lecture Notes in Mathematics 1409
(1989), chapter 4; Hairer, Wanner II, section VII.4). Up to 15 stages are available on demand: ``method("radau9")``
has five.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import prod
from typing import Any, ClassVar

import numpy as np

from ..system import State, Step, System
from ..tolerances import BELOW_ROUNDING, ITERATION_ROUNDING, NEGLIGIBLE
from . import collocation
from .collocation import collocation_step
from .controller import PI
from .radau_coefficients import RadauArrays, coefficients
from .tableau import Row, Tableau

MAX_ITERATIONS, MAX_ITERATIONS_CONTROLLED = 60, 15  # for fixed steps, and for steps that can be shortened
TYPICAL_ITERATIONS = 5
SUPPRESSED_GROWTH, LARGE_SYSTEM = 1.2, 40  # growth of h that costs more than it saves, for systems of larger dimension
MAX_STAGES = 15  # stages: with more, the eigenvectors of A are too ill-conditioned for double precision


@dataclass(frozen=True)
class RadauIIA:
    """The Radau IIA method with s stages.

    Args:
        stages: s, from 1 to 15.
    """

    stages: int

    family = "Radau IIA"
    excludes: ClassVar[Mapping[str, str]] = {}
    reference = "Hairer, Wanner, Solving Ordinary Differential Equations II, sections IV.5 and VII.4"

    def __post_init__(self) -> None:
        if not 1 <= self.stages <= MAX_STAGES:
            raise ValueError(f"a Radau IIA method has 1 to {MAX_STAGES} stages here, got {self.stages}")

    @property
    def name(self) -> str:
        """``"radau5"`` for three stages: named after the order."""
        return f"radau{self.order}"

    @property
    def title(self) -> str:
        """One line for a list of methods."""
        return "implicit Euler" if self.stages == 1 else f"Radau IIA, {self.stages} stages"

    @property
    def order(self) -> int:
        """Order of y: 2s - 1."""
        return 2 * self.stages - 1

    @property
    def order_linear(self) -> int:
        """Order of y when f is linear in z: the same."""
        return self.order

    @property
    def order_own(self) -> int:
        """Order of the method's z: s."""
        return self.stages

    @property
    def order_embedded(self) -> int:
        """Order of the embedded formula, see `mbdae.methods.collocation.collocation_step`: s."""
        return self.stages

    @property
    def error_power(self) -> int:
        """Power of h in the error estimate: s + 1, one more if a second vector improves it (s >= 3)."""
        return self.order_embedded + 1 + (self.stages >= 3)

    control = PI
    blend = 1.0
    roundings = 0
    noise = 0.0  # stages are iterated to rounding

    @property
    def solves(self) -> int:
        """Stage evaluations per step with a typical five iterations, 5 s.

        An iteration evaluates s residuals and solves s // 2 complex systems of one stage, and a real one for odd s.
        """
        return TYPICAL_ITERATIONS * self.stages

    @property
    def smallest_pivot(self) -> float:
        """1 / sum_j |omega_sj|, omega the inverse of A; the rounding error of the method's z is eps / (h times it)."""
        return 1 / float(np.abs(np.linalg.inv(self.arrays.A)[-1]).sum())

    carries = False  # data of the previous step serve as a guess only

    @cached_property
    def arrays(self) -> RadauArrays:
        """The coefficients in double precision."""
        return coefficients(self.stages).arrays

    # -- order conditions: the method as a tableau with an explicit first stage at y_n ---------------------------------

    explicit_first = True
    project_embedded = True
    rounded = True

    @cached_property
    def exact_A(self) -> list[Row]:
        """A to 40 digits with an additional zero row and column for the explicit stage, (s + 1, s + 1)."""
        rows: list[Row] = [[Fraction(0)] * (self.stages + 1)]
        rows += [[Fraction(0), *map(Fraction, row)] for row in coefficients(self.stages).A]
        return rows

    @property
    def exact_Ahat(self) -> list[Row]:
        """Equal to `exact_A`: a stage satisfies the constraint at the point where it evaluates f."""
        return self.exact_A

    @property
    def exact_b(self) -> Row:
        """The weights, the last row of A."""
        return self.exact_A[-1]

    @property
    def b_embedded(self) -> tuple[str, ...]:
        """Weights of the embedded formula: b + gamma (1, -values of the Lagrange polynomials at 0)."""
        return self._embedded(0)

    @property
    def b_companion(self) -> tuple[str, ...]:
        """Weights of the second one, which omits the first stage; empty for fewer than three stages."""
        return self._embedded(1) if self.stages >= 3 else ()

    def _embedded(self, skip: int) -> tuple[str, ...]:
        c, gamma = [Fraction(x) for x in coefficients(self.stages).c], Fraction(self.arrays.gamma)
        used = c[skip:]
        start = [prod(x / (x - y) for x in used if x != y) if y in used else Fraction(0) for y in c]
        defect = [Fraction(1), *(-x for x in start)]
        return tuple(str(b + gamma * e) for b, e in zip(self.exact_b, defect, strict=True))

    def steady(self, ny: int) -> float:
        """Return the factor below which growth of h is suppressed, to reuse partial derivatives and factors."""
        return SUPPRESSED_GROWTH if ny > LARGE_SYSTEM else 1.0

    def compiled(self, native: Any) -> Any:
        """Return the method for the compiled core, with the thresholds of its iteration."""
        a = self.arrays
        return native.Radau(
            c=a.c,
            A=a.A,
            modes=[
                native.EigenMode(
                    value=m.value, column=m.column.astype(complex).tolist(), row=m.row.astype(complex).tolist()
                )
                for m in a.modes
            ],
            real=-1 if a.real is None else a.real,
            gamma=a.gamma,
            start=a.start,
            middle=a.middle,
            patience=MAX_ITERATIONS,
            short_patience=MAX_ITERATIONS_CONTROLLED,
            extra_iterations=collocation.MAX_FURTHER_ITERATIONS,
            first_iterations=collocation.FIRST_ITERATIONS,
            below_rounding=BELOW_ROUNDING,
            iteration_rounding=ITERATION_ROUNDING,
            negligible=NEGLIGIBLE,
            expected_rate=collocation.EXPECTED_RATE,
            reuse=collocation.REUSE_RATE,
        )

    def step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step; see `mbdae.methods.collocation.collocation_step`. Its errors are empty, (0, ny)."""
        return system.compiled_step(self, t, h, state) or collocation_step(
            system, self.arrays, t, h, state, MAX_ITERATIONS, estimate=False
        )

    def controlled_step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step with an error estimate; fail if the iteration converges slowly."""
        return system.compiled_step(self, t, h, state, controlled=True) or collocation_step(
            system, self.arrays, t, h, state, MAX_ITERATIONS_CONTROLLED, estimate=True
        )


radau1, radau3, radau5 = (RadauIIA(s) for s in (1, 2, 3))

RungeKutta = Tableau | RadauIIA
