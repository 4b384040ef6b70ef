"""Singular configurations: where closures lose rank, and a motion could go on along several branches."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from . import rows as rowmath
from .compiled import Compiled
from .reactions import scaled

if TYPE_CHECKING:
    from .descriptor import Descriptor

Array = np.ndarray
SINGULAR = 1e-5  # ratio of pivots, of its usual size, where positions are kept: interpolation finds no smaller for sure
NEARLY = 1e-2  # what open loops may add to it: where they stand open so wide, a run is of another mechanism
SHARE = 1e-3  # of a closure's rows in a combination that vanishes


@dataclass(frozen=True)
class Singular:
    """A configuration on the way in which the closures lose rank.

    Attributes:
        t: time in s.
        q: configuration, (nq,).
        v: velocity, (nv,).
        rank: of the closures before and after.
        rank_there: rank in this configuration.
        closures: names of those whose rows depend on each other there, and not elsewhere.
    """

    t: float
    q: tuple[float, ...]
    v: tuple[float, ...]
    rank: int
    rank_there: int
    closures: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        n, names = len(self.closures), self.closures
        where = ", ".join(names) if n <= 4 else f"{n} closures from {names[0]} to {names[-1]}"
        return f"rank {self.rank} falls to {self.rank_there} at t = {self.t:.9g} s ({where})"


def ratio(system: "Descriptor", t: float, y: Array) -> float:
    """Smallest pivot of the independent rows of G M^-1/2 to the largest: 0 in a singular configuration."""
    found = system.ratio(system.split(y)[0]) if isinstance(system, Compiled) else None
    if found is not None:
        return found
    diagonal = rowmath.pivots(scaled(system, t, system.split(y)[0]).T)[1]
    return float(diagonal[(system.rank or 1) - 1] / diagonal[0])


def singular(
    system: "Descriptor", t: float, y: Array, before: tuple[float, Array], usual: float, gap: float
) -> Singular | None:
    """Say whether the closures lose rank at (t, y), as far as a run with |g| up to ``gap`` can tell.

    Rows that a loop has drifted open by ``gap`` keep apart from each other by its square root: a smallest pivot below
    that may be a singular configuration, or the way round one on either branch.

    Args:
        system: a workspace; its rank is that of the run.
        t: time where the pivots are smallest.
        y: the point there.
        before: time and point a little earlier, where nothing is singular.
        usual: the ratio of pivots elsewhere, where nothing is singular.
        gap: largest |g| nearby, in m or rad.
    """
    q, v = system.split(y)
    here, there = (scaled(system, *point) for point in ((before[0], system.split(before[1])[0]), (t, q)))
    size = float(np.abs(system.closures()[1]).max())
    limit = usual * min(NEARLY, SINGULAR + np.sqrt(gap / size))
    pivots = rowmath.pivots(there.T)[1]
    small = pivots <= limit * pivots[0]
    rank = system.rank or 0
    if not small[rank - 1]:
        return None
    rows = _shares(there, int((~small).sum())) - _shares(here, rank)
    names = [system.mechanism.row_closure(int(i)) for i in np.flatnonzero(rows > SHARE)]
    found = tuple(q.tolist()), tuple(v.tolist()), rank, int((~small).sum()), tuple(dict.fromkeys(names))
    return Singular(t, *found)


def _shares(G: Array, rank: int) -> Array:
    """How much each row takes part in the combinations of rows that vanish, (ng,), for the given rank."""
    left = np.linalg.svd(G)[0]
    return (left[:, rank:] ** 2).sum(axis=1)
