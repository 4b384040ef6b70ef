"""Carries of a run's method at its nodes, kept for short runs so that gradients need not recompute them."""

from typing import Any

import numpy as np

from ..system import Array, State
from .checkpoints import SHORT


class CarryRecord:
    """The carry at each node, and the nodes at which it was restarted."""

    def __init__(self) -> None:
        self.rows: dict[int, Array] = {}
        self.renewed: set[int] = set()

    def capacity_left(self, n: int) -> int:
        """Return the number of further nodes that can be kept after the first n."""
        return max(SHORT - n, 0)

    def note(self, i: int, carry: Any, restarted: bool = False) -> None:
        """Store the carry at node i."""
        if i < SHORT and isinstance(carry, np.ndarray):
            self.extend(i, carry[None], [0] if restarted else [])

    def extend(self, first: int, carries: Array, renewed: list[int]) -> None:
        """Store the carries of several nodes, (k, nc), some of them restarted."""
        at = range(first, first + len(carries))
        self.rows.update(zip(at, carries, strict=True))
        self.renewed -= set(at)
        self.renewed |= {first + i for i in renewed}

    def of(self, n: int) -> "tuple[Array, list[int]] | None":
        """Return the carries at nodes 0 to n - 2, (n - 1, nc), and the restarted ones; None if they are not known."""
        sizes = {len(self.rows.get(i, ())) for i in range(n - 1)}
        if len(sizes) != 1 or 0 in sizes:
            return None
        return np.array([self.rows[i] for i in range(n - 1)]), sorted(i for i in self.renewed if i < n)


class RecordedStates:
    """States of a run with recorded carries, see `mbdae.integrate.checkpoints`."""

    def __init__(self, ys: Array, carries: Array) -> None:
        self.ys, self.carries, self.length = ys, carries, len(ys)

    def __getitem__(self, i: int) -> State:
        """Return the state at node i, from which a step continues."""
        return State(self.ys[i], self.carries[i])

    def carried(self, i: int, j: int) -> Array:
        """Return the carries at nodes i to j - 1, (j - i, nc)."""
        return self.carries[i:j]
