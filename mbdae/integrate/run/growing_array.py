"""An array to which rows are appended."""

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ...system import Array

INITIAL_CAPACITY = 8  # rows


class GrowingArray:
    """Rows (length,) of numbers, with the interface of a list; conversion to a numpy array copies the current rows.

    The length is updated after a row is completely written, so an interrupt leaves the array consistent.
    """

    def __init__(self, first: ArrayLike) -> None:
        row = np.asarray(first, float)
        self._data, self._n = np.empty((INITIAL_CAPACITY, len(row))), 1
        self._data[0] = row

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, i: int | slice) -> Array:
        return self._data[: self._n][i]

    def __setitem__(self, i: int, row: Array) -> None:
        self._data[: self._n][i] = row

    def __delitem__(self, i: slice) -> None:
        """Remove rows at the end."""
        self._n = i.indices(self._n)[0]

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Array:
        return np.array(self._data[: self._n], dtype)

    def append(self, row: Array) -> None:
        """Add a row."""
        self.extend(row[None])

    def extend(self, rows: Array) -> None:
        """Add several rows, (n, length)."""
        n = self._n + len(rows)
        if n > len(self._data):
            data = np.empty((2 * n, self._data.shape[1]))
            data[: self._n] = self._data[: self._n]
            self._data = data
        self._data[self._n : n] = rows
        self._n = n
