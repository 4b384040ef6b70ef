"""Base class of implicit Runge-Kutta methods, whose stages are coupled: costs, control, and the compiled core."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..system import State, Step, System
from ..tolerances import BELOW_ROUNDING, ITERATION_ROUNDING, NEGLIGIBLE
from . import collocation
from .collocation import collocation_step
from .controller import PI
from .stage_arrays import StageArrays
from .tableau import Row

MAX_ITERATIONS, MAX_ITERATIONS_CONTROLLED = 60, 15  # for fixed steps, and for steps that can be shortened
TYPICAL_ITERATIONS = 5
SUPPRESSED_GROWTH, LARGE_SYSTEM = 1.2, 40  # growth of h that costs more than it saves in systems larger than this


class CoupledMethod(ABC):
    """An implicit Runge-Kutta method, see `mbdae.methods.collocation`.

    For order conditions it is a tableau with an additional explicit stage at y_n, whose z is z_n.
    """

    stages: int
    control = PI
    excludes: ClassVar[Mapping[str, str]] = {}
    blend = 1.0
    roundings = 0
    position_pivot = np.inf
    noise = 0.0  # stages are iterated to rounding
    carries = False  # the carry is only an initial guess, or z_n
    explicit_first = True

    @property
    @abstractmethod
    def arrays(self) -> StageArrays:
        """The coefficients in double precision."""

    @property
    @abstractmethod
    def exact_A(self) -> list[Row]:
        """Exact A with an additional zero row and column for the explicit stage, (s + 1, s + 1)."""

    @property
    def exact_Ahat(self) -> list[Row]:
        """The same as `exact_A`: a stage satisfies the constraint at the point where it evaluates f."""
        return self.exact_A

    @property
    def solves(self) -> int:
        """Stage evaluations per step with five iterations, a typical number: 5 s.

        An iteration evaluates s residuals and solves s // 2 complex systems of one stage, and a real one for odd s.
        """
        return TYPICAL_ITERATIONS * self.stages

    @property
    def smallest_pivot(self) -> float:
        """Pivot p = 1 / sum_jk |w_j omega_jk|, omega = A^-1, w the weights of Z; z has rounding error eps / (p h)."""
        a = self.arrays
        weights = np.eye(self.stages)[-1] if a.ends_at_stage else np.abs(a.z_weights)
        return 1 / float((weights @ np.abs(np.linalg.inv(a.A))).sum())

    def min_growth(self, ny: int) -> float:
        """Return the factor below which growth of h is suppressed, to reuse partial derivatives and factors."""
        return SUPPRESSED_GROWTH if ny > LARGE_SYSTEM else 1.0

    @property
    def in_core(self) -> bool:
        """Whether the compiled core takes its steps: if they end at a stage."""
        return self.arrays.ends_at_stage

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
            max_iterations=MAX_ITERATIONS,
            max_iterations_controlled=MAX_ITERATIONS_CONTROLLED,
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
        out = system.compiled_step(self, t, h, state) if self.in_core else None
        return out or collocation_step(system, self.arrays, t, h, state, MAX_ITERATIONS, estimate=False)
