"""Clearances of joints and closures: displacements of length at most c in the directions that a joint locks.

A clearance of a closure displaces its rows in m; a clearance of a joint of the tree displaces the origin of its child
body in the parent body. The mechanism can be assembled with displacements D x of the rows if N^T D x = 0, where N is
the left null space of G; otherwise redundant closures are violated.
Source: Haug, Computer Aided Kinematics and Dynamics (1989), 9.4.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ... import backend
from ...errors import InputError, UnknownNameError
from ...mechanism import Mechanism
from ...mechanism.discrete_sensitivity.parameter_partials import Parameters
from ...mechanism.tree.frames import joint_names
from ...mechanism.variant import variant
from ...system import Array
from ...tolerances import RANK
from ..kinematics.curve_derivatives import CurveSignals
from ..kinematics.result import Kinematics

SLIDING = ("P", "Translation", "FreeFlyer", "Helical")  # first letters of the kinds of joints whose bodies slide


class Displacements(NamedTuple):
    """Displacements of one joint or closure along w axes.

    Attributes:
        rows: displaced rows D in each pose, (n, ng, w).
        derivative: returns the derivatives of a signal with respect to the displacements, (n, w).
    """

    rows: Array
    derivative: Callable[[str], Array]

    def free(self, i: int, null: Array, scales: Array) -> Array:
        """Return an orthonormal basis of the displacements that closures allow in pose i, (w, r).

        Args:
            i: index of the pose.
            null: left null space of G with rows divided by their scales, (ng, d).
            scales: scales of the rows, (ng,).
        """
        if not null.shape[1]:
            return np.eye(self.rows.shape[2])
        _, singular_values, right = np.linalg.svd(null.T @ (self.rows[i] / scales[:, None]))
        return right[np.count_nonzero(singular_values * scales.max() > RANK) :].T


def displacements(signals: CurveSignals, names: Iterable[str]) -> dict[str, Displacements]:
    """Return the displacements of joints and closures by name; a closure has precedence over a joint of its name.

    Raises:
        UnknownNameError: for any other name.
        InputError: for a closure without rows in m, or a sliding joint.
    """
    mech, found = signals.parameters.mech, {}
    closures, joints = [c.name for c in mech.closures], joint_names(mech.model)
    for name in names:
        if name in closures:
            found[name] = _of_closure(signals, mech, name)
        elif name in joints:
            found[name] = _of_joint(signals.curve, mech, name)
        else:
            raise UnknownNameError("joint or closure", name, [*closures, *joints])
    return found


def _of_closure(signals: CurveSignals, mech: Mechanism, name: str) -> Displacements:
    rows = [i for i in mech.rows_of(name) if mech.row_units[i] == "m"]
    if not rows:
        raise InputError(f"closure {name!r} has no rows in m: it has no clearance")
    D = np.broadcast_to(np.eye(mech.ng)[:, rows], (len(signals.curve.u), mech.ng, len(rows)))
    return Displacements(D, lambda output: -signals.reactions(output)[:, rows])


def _of_joint(found: Kinematics, mech: Mechanism, name: str) -> Displacements:
    if mech.joint_kind(name).startswith(SLIDING) and mech.joint_kind(name) != "Planar":
        raise InputError(f"joint {name!r} slides: a clearance is that of a joint that locks a point, or of a closure")
    axes = [f"{name}.{axis}" for axis in "xyz"]

    def make(values: Mapping[str, float]) -> Mechanism:
        model = mech.model.copy()
        placement = model.jointPlacements[model.getJointId(name)]
        placement.translation = placement.translation + np.array([values.get(axis, 0.0) for axis in axes])
        return variant(mech, model=model)

    parameters = Parameters(make, dict.fromkeys(axes, 0.0), backend.load())
    signals = CurveSignals(found, lambda: parameters)
    return Displacements(signals.poses.rows, signals.derivative)


def largest_axis_count(found: Sequence[Displacements]) -> int:
    """Return the largest number of axes; 1 without displacements."""
    return max((x.rows.shape[2] for x in found), default=1)
