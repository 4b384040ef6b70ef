"""A section of a periodic motion: a level that one of its signals crosses once per period, at its start."""

from collections.abc import Sequence

import numpy as np

from ...mechanism import Mechanism
from ...mechanism.tree.coordinate_units import coordinate_units
from ...solution.signals import signals
from ...solution.solution import Solution
from ...tolerances import VISIBLE


def section_of(mech: Mechanism, runs: Sequence[Solution]) -> str:
    """Return ``"signal > level"`` or ``"signal < level"`` for the coordinate or velocity with the fastest crossing.

    It crosses its level once per period in this direction. Empty if no signal does, at rest and for steady motions.
    """
    names = list(coordinate_units(mech))
    tables = [signals(run, names) for run in runs]
    columns = {name: np.concatenate([table[name] for table in tables]) for name in names}
    largest = {kind: max(np.abs(x).max() for name, x in columns.items() if name[0] == kind) for kind in "qv"}
    t = np.concatenate([run.nodes[0] for run in runs])
    best, section = VISIBLE, ""
    for name, x in columns.items():
        size, level = float(np.ptp(x)), float(x[0])
        if size <= VISIBLE * largest[name[0]]:
            continue
        rate = (x[1] - level) / (t[1] - t[0]) * (t[-1] - t[0]) / size
        if abs(rate) > best and _crosses_once(np.sign(rate) * (x - level), abs(x[-1] - level) <= VISIBLE * size):
            best, section = abs(rate), f"{name} {'>' if rate > 0 else '<'} {level:.9g}"
    return section


def _crosses_once(above: np.ndarray, returns: bool) -> bool:
    """Return whether values rise through zero only at the start of a period; ``returns``: whether they end at zero."""
    inside = above[1:-1]
    rises = np.count_nonzero((inside[:-1] <= 0) & (inside[1:] > 0))
    return bool(not rises and (not returns or (inside < 0).any()))
