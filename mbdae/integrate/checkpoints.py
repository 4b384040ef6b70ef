"""Checkpointed states of repeatable steps: every k-th one is kept, those between are recomputed.

For n steps and k near the root of n that is 2 k states instead of n, at the cost of repeating each step once (Griewank,
Optim. Methods Softw. 1 (1992), one level). A repeated segment is bitwise equal, as steps are functions of their start.
"""

from collections.abc import Callable
from math import isqrt

import numpy as np

from ..system import Array, State

SHORT = 1000  # steps up to which all states are kept

Recompute = Callable[[int, int, State], list[State]]


class Checkpoints:
    """States at n nodes.

    Args:
        n: number of nodes.
        start: the state at node 0.
        walk: i, j and the state at node i -> the states at nodes i, ..., j. Called for all nodes once, later segment by
            segment.

    Attributes:
        length: of a segment, in nodes: k.
    """

    def __init__(self, n: int, start: State, walk: Recompute) -> None:
        self.n, self.walk, self.length = n, walk, max(SHORT, isqrt(n))
        self.kept = [start]
        while len(self.kept) * self.length < n:
            self.kept.append(self._found(len(self.kept) - 1).pop())
        self._found(len(self.kept) - 1)

    def __getitem__(self, i: int) -> State:
        """Return the state at node i."""
        return self.segment(i // self.length)[i % self.length]

    def carried(self, i: int, j: int) -> Array:
        """Return the carries at nodes i to j - 1, (j - i, nc)."""
        return np.array([self[k].carry for k in range(i, j)])

    def segment(self, j: int) -> list[State]:
        """Return the states at nodes j k, ..., j k + k - 1, possibly with one more."""
        return self._states if j == self._at else self._found(j)

    def _found(self, j: int) -> list[State]:
        first = j * self.length
        self._at, self._states = j, self.walk(first, min(first + self.length, self.n - 1), self.kept[j])
        return self._states
