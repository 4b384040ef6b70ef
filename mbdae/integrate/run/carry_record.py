"""Carries of the method at the nodes of a run."""

import numpy as np

from ...system import Array
from ..trajectory.checkpoints import MAX_STORED


class CarryRecord:
    """The carry at each node, and the nodes at which it was restarted."""

    def __init__(self) -> None:
        self.blocks: list[Array] = []  # carries (k, nc) at consecutive nodes, from the first one on
        self.n = 0
        self.restarted: list[int] = []

    def capacity_left(self, n: int) -> int:
        """Return the number of nodes after the first n whose carries can be stored."""
        return max(MAX_STORED - n, 0)

    def store(self, i: int, carry: object, restarted: bool = False) -> None:
        """Store the carry at node i."""
        if i < MAX_STORED and isinstance(carry, np.ndarray):
            self.extend(i, carry[None], [0] if restarted else [])

    def extend(self, first: int, carries: Array, restarted: list[int]) -> None:
        """Store the carries at nodes from ``first`` on, (k, nc), replacing stored ones; after a gap, store nothing.

        Args:
            first: first of the nodes.
            carries: the carries.
            restarted: which of the nodes, counted from ``first``, restart the carry.
        """
        while self.n > first:
            block = self.blocks.pop()
            self.n -= len(block)
            if self.n < first:
                self._append(block[: first - self.n])
        if self.n != first or (first and carries.shape[1] != self.blocks[0].shape[1]):
            return
        self._append(carries)
        if restarted or self.restarted:
            self.restarted = [i for i in self.restarted if i < first] + [first + i for i in restarted]

    def _append(self, block: Array) -> None:
        self.blocks.append(block)
        self.n += len(block)

    def up_to(self, n: int) -> tuple[Array, list[int]] | None:
        """Return the carries at nodes 0 to n - 1, (n, nc), and nodes to n that restart it; None if one is missing."""
        if not 0 < n <= self.n:
            return None
        if len(self.blocks) > 1:
            self.blocks = [np.concatenate(self.blocks)]
        return self.blocks[0][:n], [i for i in self.restarted if i <= n]
