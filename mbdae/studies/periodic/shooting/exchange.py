"""Exchange of joints at the end of a period: the legs of a walker, the two sides of a symmetric mechanism.

    y(t + T) = P y(t),   (P q)_i = +- q_j,   (P q)_j = +- q_i,   P^2 = 1

Half a stride, or half a swing, is then a period; its multipliers are those of P phi_T.
"""

from collections.abc import Mapping

import numpy as np

from ....errors import InputError, UnknownNameError, require
from ....mechanism import Mechanism
from ....system import Array


class Exchange:
    """Exchange map P of joints of one coordinate.

    Args:
        mech: the mechanism.
        joints: joint = other joint, with a preceding ``"-"`` for the opposite sign; a joint may be mapped to itself
            with the opposite sign.

    Raises:
        InputError: for joints of several coordinates, joints in two pairs, or forces with states.
        UnknownNameError: for an unknown joint.
    """

    def __init__(self, mech: Mechanism, joints: Mapping[str, str] | None = None) -> None:
        joints = {} if joints is None else joints
        require(joints, Mapping, "exchange is a table, joint = other joint")
        if joints and mech.states:
            raise InputError(f"exchange: forces with states are not exchanged, got {', '.join(mech.states)}")
        model = mech.model
        single = [n for n in mech.joint_names if model.joints[model.getJointId(n)].nq == 1]
        self.of_q, self.of_v, self.states, seen = np.eye(mech.nq), np.eye(mech.nv), len(mech.states), set[str]()
        for first, text in joints.items():
            second, sign = str(text).removeprefix("-"), -1.0 if str(text).startswith("-") else 1.0
            for name in {first, second}:
                if name not in single:
                    raise UnknownNameError("joint of one coordinate", name, single)
                if name in seen:
                    raise InputError(f"exchange: joint {name!r} is in two pairs")
                seen.add(name)
            a, b = (model.joints[model.getJointId(name)] for name in (first, second))
            for P, i, j in ((self.of_q, a.idx_q, b.idx_q), (self.of_v, a.idx_v, b.idx_v)):
                P[i, i] = P[j, j] = 0.0
                P[i, j] = P[j, i] = sign

    def apply(self, q: Array) -> Array:
        """Return P q, (nq,)."""
        return self.of_q @ q

    def __bool__(self) -> bool:
        """Return whether joints are exchanged."""
        return bool((self.of_v != np.eye(len(self.of_v))).any())

    @property
    def tangent(self) -> Array:
        """The map of tangents of (q, v, s, work), (ny, ny)."""
        n, nv = 2 * len(self.of_v) + self.states + 1, len(self.of_v)
        out = np.eye(n)
        out[:nv, :nv] = out[nv : 2 * nv, nv : 2 * nv] = self.of_v
        return out

    def of_state(self, y: Array) -> Array:
        """Return y = (q, v, s, work) with exchanged joints, (n,)."""
        nq, out = len(self.of_q), y.copy()
        out[:nq], out[nq : nq + len(self.of_v)] = self.apply(y[:nq]), self.of_v @ y[nq : nq + len(self.of_v)]
        return out
