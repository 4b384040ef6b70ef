"""Types of data that leave Python: JSON documents, and what the compiled core reads."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

Json: TypeAlias = bool | int | float | str | Sequence[Any] | Mapping[str, Any] | None
JsonObject: TypeAlias = dict[str, Json]

CoreData: TypeAlias = dict[str, Any]
"""Fields of a C++ struct by name: numbers, lists, arrays, Python functions. The core checks names and types."""


class RunParameters(NamedTuple):
    """Parameters that differ between runs, as numbers in the core; see `in_place_parameters`.

    Attributes:
        locations: where the n numbers are in the core.
        values: those of each run, (k, n).
    """

    locations: Sequence[CoreData] = ()
    values: np.ndarray = np.empty(0)

    def of_runs(self, which: np.ndarray) -> "RunParameters":
        """Return the parameters of some runs, by indices or Booleans."""
        return self._replace(values=self.values[which]) if self.locations else self
