"""Radau IIA methods: implicit, stiffly accurate, of order 2s - 1 in y and s in the multipliers of the method.

This follows from the assumptions B(2s - 1), C(s), D(s - 1) (Hairer, Lubich, Roche, Lecture Notes in Mathematics 1409
(1989), chapter 4; Hairer, Wanner II, section VII.4). Up to 15 stages are available on demand: ``method("radau9")``
has five.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import prod

from ..system import State, Step, System
from .collocation import collocation_step
from .coupled_method import MAX_ITERATIONS_CONTROLLED, CoupledMethod
from .radau_coefficients import coefficients
from .stage_arrays import StageArrays
from .tableau import Row

MAX_STAGES = 15  # stages: with more, the eigenvectors of A are too ill-conditioned for double precision


@dataclass(frozen=True)
class RadauIIA(CoupledMethod):
    """The Radau IIA method with s stages.

    Args:
        stages: s, from 1 to 15.
    """

    stages: int

    family = "Radau IIA"
    R_infinity = 0.0  # b is the last row of A
    reference = "Hairer, Wanner, Solving Ordinary Differential Equations II, sections IV.5 and VII.4"

    def __post_init__(self) -> None:
        if not 1 <= self.stages <= MAX_STAGES:
            raise ValueError(f"a Radau IIA method has 1 to {MAX_STAGES} stages, got {self.stages}")

    @property
    def name(self) -> str:
        """Name after the order: ``"radau5"`` for three stages."""
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
        """Order of y when f is linear in z, equal to `order`."""
        return self.order

    @property
    def order_own(self) -> int:
        """Order of the z of the method: s."""
        return self.stages

    @property
    def order_embedded(self) -> int:
        """Order of the embedded formula, see `mbdae.methods.collocation.collocation_step`: s."""
        return self.stages

    @property
    def error_power(self) -> int:
        """Power of h in the error estimate: s + 1, one more if a second estimate improves it (s >= 3)."""
        return self.order_embedded + 1 + (self.stages >= 3)

    @cached_property
    def arrays(self) -> StageArrays:  # type: ignore[override]
        """The coefficients in double precision."""
        return coefficients(self.stages).arrays

    # -- order conditions: see `CoupledMethod` -------------------------------------------------------------------------

    project_embedded = True
    rounded = True

    @cached_property
    def exact_A(self) -> list[Row]:  # type: ignore[override]
        """A to 40 digits with an additional zero row and column for the explicit stage, (s + 1, s + 1)."""
        rows: list[Row] = [[Fraction(0)] * (self.stages + 1)]
        rows += [[Fraction(0), *map(Fraction, row)] for row in coefficients(self.stages).A]
        return rows

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
        """Weights of the second embedded formula, without the first stage; empty for fewer than three stages."""
        return self._embedded(1) if self.stages >= 3 else ()

    def _embedded(self, skip: int) -> tuple[str, ...]:
        c, gamma = [Fraction(x) for x in coefficients(self.stages).c], Fraction(self.arrays.gamma)
        nodes = c[skip:]
        start = [prod(x / (x - y) for x in nodes if x != y) if y in nodes else Fraction(0) for y in c]
        defect = [Fraction(1), *(-x for x in start)]
        return tuple(str(b + gamma * e) for b, e in zip(self.exact_b, defect, strict=True))

    def controlled_step(self, system: System, t: float, h: float, state: State) -> Step:
        """Take one step with an error estimate; fail if the iteration converges slowly."""
        return system.compiled_step(self, t, h, state, controlled=True) or collocation_step(
            system, self.arrays, t, h, state, MAX_ITERATIONS_CONTROLLED, estimate=True
        )


radau1, radau3, radau5 = (RadauIIA(s) for s in (1, 2, 3))
