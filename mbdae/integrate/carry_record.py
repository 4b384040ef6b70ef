"""What a run's method carried to its nodes: kept for short runs, so that gradients need not take their steps again."""

from typing import Any

import numpy as np

from ..system import Array, State
from .checkpoints import SHORT


class CarryRecord:
    """What is carried, node by node, and where it was found anew."""

    def __init__(self) -> None:
        self.rows: dict[int, Array] = {}
        self.renewed: set[int] = set()

    def capacity_left(self, n: int) -> int:
        """How many more nodes are kept behind the first n."""
        return max(SHORT - n, 0)

    def note(self, i: int, carry: Any, anew: bool = False) -> None:
        """Keep what is carried from node i."""
        if i < SHORT and isinstance(carry, np.ndarray):
            self.extend(i, carry[None], [0] if anew else [])

    def extend(self, first: int, carries: Array, renewed: list[int]) -> None:
        """Keep what is carried from several nodes, (k, nc), some of them with something new."""
        at = range(first, first + len(carries))
        self.rows.update(zip(at, carries, strict=True))
        self.renewed -= set(at)
        self.renewed |= {first + i for i in renewed}

    def of(self, n: int) -> "tuple[Array, list[int]] | None":
        """What is carried from nodes 0 to n - 2, (n - 1, nc), and where it was found anew; None if it is not known."""
        sizes = {len(self.rows.get(i, ())) for i in range(n - 1)}
        if len(sizes) != 1 or 0 in sizes:
            return None
        return np.array([self.rows[i] for i in range(n - 1)]), sorted(i for i in self.renewed if i < n)


class RecordedStates:
    """The states of a run that kept what its method carried, see `mbdae.integrate.checkpoints`."""

    def __init__(self, ys: Array, carries: Array) -> None:
        self.ys, self.carries, self.length = ys, carries, len(ys)

    def __getitem__(self, i: int) -> State:
        """The state at node i, from which a step goes on."""
        return State(self.ys[i], self.carries[i])

    def carried(self, i: int, j: int) -> Array:
        """What is carried from nodes i to j - 1, (j - i, nc)."""
        return self.carries[i:j]
