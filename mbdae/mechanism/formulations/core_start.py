"""Start of a run in the compiled core: rank and rows in use, the first derivative, and the first step size."""

from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...system import Array
from ...tolerances import SOLUTION_ROUNDING
from ..closures.independent_rows import RANK_LOSS_FACTOR
from ..run_parameters import RunParameters
from ..tree.tree_terms import symmetric
from .index2 import Index2System

if TYPE_CHECKING:
    from ..._native import Core, Run, RunStart


class CoreStart(Index2System):
    """Functions of a workspace at the start of a run, computed by the core.

    Attributes:
        native: the core as a module, see `mbdae.backend`.
        core: the mechanism in the core.
    """

    native: ModuleType
    core: "Core"
    _rank_known: bool

    def mass_matrices(self, q: Array, parameters: RunParameters) -> Array:
        """Return the mass matrices (k, nv, nv) at q, without flexible bodies, for parameters of k runs."""
        locations = [self.native.ParameterLocation(**x) for x in parameters.locations]
        return symmetric(self.core.mass_matrices(q, locations, parameters.values).swapaxes(1, 2))

    @property
    def starts_in_core(self) -> bool:
        """Whether the core determines the rank; not for mechanisms with modes."""
        return self.formulation == "index2" and not self.mechanism.switches and not self._rank_known

    def start(self, t: float, y: Array, project: bool) -> tuple[Array, Array, Array]:
        """See `mbdae.system.System`; in Python with modes, for equal pivots, and near singular configurations."""
        found = None
        if self.starts_in_core:
            found = self.core.start(t, y, project, self.ambiguous_pivot, RANK_LOSS_FACTOR, SOLUTION_ROUNDING)
        self.take_core_record()
        return super().start(t, y, project) if found is None else self._started(*found)

    def begin(
        self, method: Any, run: "Run", shortest: float, first_step: dict[str, Any] | None
    ) -> tuple[Array, Array, Array] | None:
        """Begin a run in the core, and take many steps; return the values of `start`, or None if Python must begin it.

        Args:
            method: the method.
            run: the run, at its first point; the steps are added to it.
            shortest: smallest first step in s.
            first_step: data to choose the first step, unless its size is given.
        """
        start = self.run_start(shortest)
        first = self.native.FirstStep(**first_step) if first_step else None
        found = self.core.begin(self.method(method), start, first, run)
        self.take_core_record()
        return self._started(*found) if found else None

    def run_start(self, shortest: float, longest: int = 0) -> "RunStart":
        """Return the data of the start of a run, with its smallest first step in s and largest number of steps."""
        return self.native.RunStart(
            ambiguous=self.ambiguous_pivot, fallen=RANK_LOSS_FACTOR, dependent=SOLUTION_ROUNDING, shortest=shortest,
            longest=longest,
        )  # fmt: skip

    def _started(self, y: Array, F: Array, z: Array, rows: list[int], floor: float) -> tuple[Array, Array, Array]:
        """Copy the rows in use at the start of a run from the core."""
        self.rows, self.rank, self.rows_frozen, self._rank_known = np.array(rows, int), len(rows), True, True
        self.rank_threshold = floor
        return y, F, z

    def first_step(self, t: float, y: Array, F: Array, **given: Any) -> float | None:
        """See `mbdae.system.System`."""
        known = self._rank_known and self.rows_frozen
        found = self.core.first_step(t, y, F, self.native.FirstStep(**given)) if known else None
        self.take_core_record()
        return found

    def method(self, method: Any) -> Any:
        """Return the core's version of a method."""
        raise NotImplementedError

    def take_core_record(self) -> None:
        """Add the core's counts to those of the system, and update its extremes."""
        raise NotImplementedError
