"""Initial points of variants of a mechanism that differ only in start values."""

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import UnknownNameError
from ...system import Array
from ..tree.frames import find_joint
from .assembly import InitialEstimate, assemble_from, start_estimate

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class _Entry(NamedTuple):
    """Index of a start value in q or v."""

    is_velocity: bool
    place: int


class InitialPoints:
    """Initial points of a mechanism for other start values, each with the bits of that of a new variant.

    Args:
        mech: the mechanism; its file or variant gives these start values, too.
        names: of the start values that change, ``v.crank``; joints have one coordinate.
        t: time of the start in s.
    """

    def __init__(self, mech: "Mechanism", names: tuple[str, ...], t: float) -> None:
        self.mech, self.t, self.states = mech, t, np.array([*mech.states.values(), 0.0])
        found = [_entry(mech, name) for name in names]
        self.entries = [x for x in found if x]
        simple = len(self.entries) == len(found) and not mech.drivers and mech.start_values.assemble
        self.estimate: InitialEstimate | None = start_estimate(mech) if simple else None

    def at(self, values: Mapping[str, Any]) -> Array | None:
        """Return the point (n,) for values in the order of ``names``; None where a new variant must be made.

        Raises:
            AssemblyError: if no consistent point is found.
        """
        if self.estimate is None or not all(type(x) in (int, float) and isfinite(x) for x in values.values()):
            return None
        q, v = self.estimate.q.copy(), self.estimate.v.copy()
        for entry, x in zip(self.entries, values.values(), strict=True):
            (v if entry.is_velocity else q)[entry.place] = x
        found = assemble_from(self.mech, self.estimate._replace(q=q, v=v), self.t)
        return np.concatenate([found.q, found.v, self.states])


def _entry(mech: "Mechanism", name: str) -> _Entry | None:
    table, _, joint_name = name.partition(".")
    try:
        joint = find_joint(mech.model, joint_name)
    except UnknownNameError:
        return None
    if table not in ("q", "v") or joint.nq != 1 or joint.nv != 1:
        return None
    return _Entry(table == "v", joint.idx_v if table == "v" else joint.idx_q)
