"""Rank loss of mechanisms with many rows in the compiled core, in linear time."""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ...tolerances import SEARCH_TOLERANCE
from ..closures.independent_rows import MANY_ROWS, random_probe
from .index2 import Index2System
from .steps.row_selection import SmallestPivot

if TYPE_CHECKING:
    from ..._native import Core


class CoreRankLoss(Index2System):
    """Functions of a workspace near singular configurations, computed by the core.

    Attributes:
        core: the mechanism in the core.
    """

    core: "Core"

    def smallest_pivot(self, t: float, y: Array) -> SmallestPivot:
        """See `Index2System.smallest_pivot`."""
        found = self.core.smallest_pivot(np.ascontiguousarray(self.split(y)[0]), self.rank or 1)
        return super().smallest_pivot(t, y) if found is None else SmallestPivot(*found)

    def remaining_rows_dependent(self, t: float, y: Array) -> bool:
        """See `Index2System.remaining_rows_dependent`."""
        return bool(self.core.remaining_rows_dependent(self.split(y)[0].copy(), SEARCH_TOLERANCE))

    def null_spaces(self, configurations: list[Array]) -> list[Array]:
        """See `Index2System.null_spaces`; from random vectors."""
        k, found = self.nv - (self.rank or 0), []
        if self.ng > MANY_ROWS:
            vectors = random_probe(k * self.nv).reshape(k, self.nv)
            found = [self.core.admissible_velocities(q, vectors) for q in configurations]
        scales = self.mechanism.coordinate_scales
        bases = [np.linalg.qr((x / scales).T)[0] for x in found if x is not None]
        return bases if len(bases) == len(configurations) else super().null_spaces(configurations)

    def vanishing_combinations(
        self, t: float, q: Array, rank: int, limit: float, vectors: Array
    ) -> tuple[int, Array]:
        """See `Index2System.vanishing_combinations`."""
        found = None
        if self.ng > MANY_ROWS:
            found = self.core.vanishing_combinations(q, rank, limit, np.ascontiguousarray(vectors.T))
        return super().vanishing_combinations(t, q, rank, limit, vectors) if found is None else (found[0], found[1].T)

    def residual_of_dependent_rows(self, t: float, q: Array, limit: float, steps: int) -> float:
        """See `Index2System.residual_of_dependent_rows`."""
        found = self.core.residual_of_dependent_rows(t, q, limit, steps) if self.ng > MANY_ROWS else None
        return super().residual_of_dependent_rows(t, q, limit, steps) if found is None else found
