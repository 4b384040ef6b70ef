"""Initial points of variants of a mechanism that differ in start values and inertias of bodies."""

from collections.abc import Sequence
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import MbdaeError, UnknownNameError
from ...system import Array
from ..closures.independent_rows import MANY_ROWS
from ..run_parameters import RunParameters
from ..tree.frames import find_joint
from .assembly import InitialEstimate, assemble_from, start_estimate

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class _Entry(NamedTuple):
    """Component of a start value in q or v."""

    is_velocity: bool
    component: int


class InitialPoints:
    """Initial points of a mechanism for other start values, each bitwise equal to the point of a new variant.

    Args:
        mech: the mechanism, which has start values of these names.
        names: names of the start values that change, ``v.crank``, of joints with one coordinate.
        t: time of the start in s.
    """

    def __init__(self, mech: "Mechanism", names: tuple[str, ...], t: float) -> None:
        self.mech, self.t, self.states = mech, t, np.array([*mech.states.values(), 0.0])
        found = [_entry(mech, name) for name in names]
        self.entries = [x for x in found if x]
        supported = len(self.entries) == len(found) and not mech.drivers and mech.start_values.assemble
        self.estimate: InitialEstimate | None = start_estimate(mech) if supported else None
        velocities = all(entry.is_velocity for entry in self.entries)
        self.together = self.estimate is not None and velocities and not len(self.estimate.locked_v)

    def at(self, columns: Sequence[Sequence[Any]], k: int, parameters: RunParameters) -> Array:
        """Return the points of k runs, (k, n); nan where a new variant is needed.

        A new variant is needed for values that are not numbers, and to report why a point is not consistent.

        Args:
            columns: k values for each of ``names``.
            k: number of runs.
            parameters: parameters of each run that determine inertias of bodies.
        """
        values = np.array([[x if type(x) in (int, float) else nan for x in column] for column in columns], float)
        values = values.reshape(len(columns), k)
        out = np.full((k, self.mech.nq + self.mech.nv + len(self.states)), nan)
        if self.estimate is None or (parameters.locations and self.mech.ng > MANY_ROWS):
            return out
        valid = np.flatnonzero(np.isfinite(values).all(axis=0))
        groups = [valid] if self.together and len(valid) else [*valid[:, None]]
        while groups:
            group = groups.pop()
            try:
                out[group] = self._points(values[:, group], parameters.of_runs(group))
            except MbdaeError:
                groups += [*group[:, None]] if len(group) > 1 else []
        return out

    def _points(self, columns: Array, parameters: RunParameters) -> Array:
        """Return the points of runs with the same configuration, (k, n), for the values of each entry, (.., k).

        Raises:
            AssemblyError, InputError: if any point is not consistent, or its mass matrix is singular.
        """
        assert self.estimate is not None
        q, v = self.estimate.q.copy(), np.tile(self.estimate.v, (columns.shape[1], 1))
        for entry, x in zip(self.entries, columns, strict=True):
            if entry.is_velocity:
                v[:, entry.component] = x
            else:
                q[entry.component] = x[0]
        found = assemble_from(self.mech, self.estimate._replace(q=q, v=v, parameters=parameters), self.t)
        return np.hstack([np.tile(found.q, (len(v), 1)), found.v, np.tile(self.states, (len(v), 1))])


def _entry(mech: "Mechanism", name: str) -> _Entry | None:
    table, _, joint_name = name.partition(".")
    try:
        joint = find_joint(mech.model, joint_name)
    except UnknownNameError:
        return None
    if table not in ("q", "v") or joint.nq != 1 or joint.nv != 1:
        return None
    return _Entry(table == "v", joint.idx_v if table == "v" else joint.idx_q)
