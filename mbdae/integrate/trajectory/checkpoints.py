"""Checkpoints of a run: every k-th state is stored, and the states in between are recomputed.

For n steps, k is the square root of n, but at least 1000, so that short runs store all states. This stores n/k + k
states instead of n, at the cost of repeating each step once (Griewank, Optim. Methods Softw. 1 (1992), one level). A
recomputed segment is bitwise equal, since a step depends only on the state at its start.
"""

from collections.abc import Callable
from math import isqrt

import numpy as np

from ...system import Array, State

MAX_STORED = 1000  # number of states: runs with at most as many store all

Recompute = Callable[[int, int, State], list[State]]


class Checkpoints:
    """States at n nodes.

    Args:
        n: number of nodes.
        start: the state at node 0.
        recompute: (i, j, state at node i) -> the states at nodes i, ..., j; called once for all nodes, later for one
            segment.

    Attributes:
        length: number of nodes of a segment, k.
    """

    def __init__(self, n: int, start: State, recompute: Recompute) -> None:
        self.n, self.recompute, self.length = n, recompute, max(MAX_STORED, isqrt(n))
        self.saved = [start]
        while len(self.saved) * self.length < n:
            self.saved.append(self._recompute_segment(len(self.saved) - 1).pop())
        self._recompute_segment(len(self.saved) - 1)

    def __getitem__(self, i: int) -> State:
        """Return the state at node i."""
        return self.segment(i // self.length)[i % self.length]

    def carries_between(self, i: int, j: int) -> Array:
        """Return the carries at nodes i to j - 1, (j - i, nc)."""
        return np.array([self[k].carry for k in range(i, j)])

    def segment(self, j: int) -> list[State]:
        """Return the states at nodes j k, ..., j k + k - 1, possibly with the first state of the next segment."""
        return self._states if j == self._segment_index else self._recompute_segment(j)

    def _recompute_segment(self, j: int) -> list[State]:
        first, last = j * self.length, min((j + 1) * self.length, self.n - 1)
        self._segment_index, self._states = j, self.recompute(first, last, self.saved[j])
        return self._states


class RecordedStates:
    """States of a run with stored carries, with the interface of `Checkpoints`."""

    def __init__(self, ys: Array, carries: Array) -> None:
        self.ys, self.carries, self.length = ys, carries, len(ys)

    def __getitem__(self, i: int) -> State:
        """Return the state at node i, from which the next step starts."""
        return State(self.ys[i], self.carries[i])

    def carries_between(self, i: int, j: int) -> Array:
        """Return the carries at nodes i to j - 1, (j - i, nc)."""
        return self.carries[i:j]
