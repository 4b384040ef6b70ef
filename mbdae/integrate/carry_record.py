"""Carries of the method at the nodes of a run: stored for short runs, which saves gradients from recomputing them."""

from typing import Any

import numpy as np

from ..system import Array, State
from .checkpoints import MAX_STORED


class CarryRecord:
    """The carry at each node, and the nodes at which it was restarted."""

    def __init__(self) -> None:
        self.rows: dict[int, Array] = {}
        self.restarted: set[int] = set()

    def capacity_left(self, n: int) -> int:
        """Return for how many nodes after the first n carries can be stored."""
        return max(MAX_STORED - n, 0)

    def store(self, i: int, carry: Any, restarted: bool = False) -> None:
        """Store the carry at node i."""
        if i < MAX_STORED and isinstance(carry, np.ndarray):
            self.extend(i, carry[None], [0] if restarted else [])

    def extend(self, first: int, carries: Array, restarted: list[int]) -> None:
        """Store the carries of several nodes, (k, nc), some of them restarted."""
        nodes = range(first, first + len(carries))
        self.rows.update(zip(nodes, carries, strict=True))
        self.restarted -= set(nodes)
        self.restarted |= {first + i for i in restarted}

    def up_to(self, n: int) -> "tuple[Array, list[int]] | None":
        """Return the carries at nodes 0 to n - 2, (n - 1, nc), and the restarted nodes; None if one is not stored."""
        sizes = {len(self.rows.get(i, ())) for i in range(n - 1)}
        if len(sizes) != 1 or 0 in sizes:
            return None
        return np.array([self.rows[i] for i in range(n - 1)]), sorted(i for i in self.restarted if i < n)


class RecordedStates:
    """States of a run with stored carries, with the interface of `mbdae.integrate.checkpoints.Checkpoints`."""

    def __init__(self, ys: Array, carries: Array) -> None:
        self.ys, self.carries, self.length = ys, carries, len(ys)

    def __getitem__(self, i: int) -> State:
        """Return the state at node i, from which the next step starts."""
        return State(self.ys[i], self.carries[i])

    def carries_between(self, i: int, j: int) -> Array:
        """Return the carries at nodes i to j - 1, (j - i, nc)."""
        return self.carries[i:j]
