"""The states along many steps that can be taken again: every k-th one is kept, those between are found anew.

For n steps and k near the root of n that is 2 k states instead of n, for one repetition of each step (Griewank, Optim.
Methods Softw. 1 (1992), on one level). A repeated segment has the same bits, as steps are functions of their start.
"""

from collections.abc import Callable
from math import isqrt

from ..system import State

SHORT = 1000  # steps of which all states are kept

Advance = Callable[[int, State], State]


class Checkpoints:
    """The states at n nodes.

    Args:
        n: number of nodes.
        start: the state at node 0.
        advance: i and the state at node i -> that at node i + 1. It goes along all steps once, and then by segments.

    Attributes:
        length: of a segment, in nodes: k.
    """

    def __init__(self, n: int, start: State, advance: Advance) -> None:
        self.n, self.advance, self.length = n, advance, max(SHORT, isqrt(n))
        self.kept = [start]
        while len(self.kept) * self.length < n:
            self.kept.append(advance(len(self.kept) * self.length - 1, self._walk(len(self.kept) - 1)[-1]))
        self._walk(len(self.kept) - 1)

    def __getitem__(self, i: int) -> State:
        """The state at node i."""
        return self.segment(i // self.length)[i % self.length]

    def segment(self, j: int) -> list[State]:
        """The states at nodes j k, ..., j k + k - 1."""
        return self._states if j == self._at else self._walk(j)

    def _walk(self, j: int) -> list[State]:
        first, state = j * self.length, self.kept[j]
        states = [state]
        for i in range(first, min(first + self.length, self.n) - 1):
            state = self.advance(i, state)
            states.append(state)
        self._at, self._states = j, states
        return states
