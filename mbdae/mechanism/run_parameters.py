"""Parameters that differ between runs in the compiled core."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..data_types import CoreData
from ..system import Array


class RunParameters(NamedTuple):
    """Values of n parameters in k runs; see `mbdae.mechanism.formats.in_place_parameters`.

    Attributes:
        locations: locations of the n parameters in the core.
        values: values in each run, (k, n).
    """

    locations: Sequence[CoreData] = ()
    values: Array = np.empty(0)

    def of_runs(self, which: Array) -> "RunParameters":
        """Return the parameters of some runs, by indices or Booleans."""
        return self._replace(values=self.values[which]) if self.locations else self
