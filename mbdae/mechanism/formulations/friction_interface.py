"""One friction interface: direction and speed of slip."""

from typing import Any, NamedTuple

import numpy as np

from ...system import Array
from ...tolerances import TINY
from ..closures.closure import Closure, Z
from ..closures.contact import ContactHeightRow
from ..closures.line_rows import at_rest
from ..closures.rows import unit_axis
from ..forces.coulomb_friction import CoulombFriction
from ..frames import Pair, cross

TURNS = ("turns", "bears")  # friction torques, in a bearing with a radius
TURNED = 0.7  # cosine: a slip that rotates further within one step has no reliable direction


class FrictionInterface(NamedTuple):
    """Friction interface between two bodies.

    Attributes:
        force: friction as given by the user.
        closure: closure whose reaction causes the friction.
        pair: frames of the closure.
        rows: rows whose multipliers make up F.
        grip: no-slip rows that may slide.
    """

    force: CoulombFriction
    closure: Closure
    pair: Pair
    rows: slice
    grip: slice

    def along(self, v: Array, W: Array, heading: Array, still: float) -> Array:
        """Return the slip direction (m,) along inactive no-slip rows; updates heading.

        Through zero slip the direction is continued: a mode ends there.
        """
        slip = W[:, self.grip].T @ self.pair.relative(v)
        size = float(np.sqrt(slip @ slip))
        if size <= still:
            return heading
        along = slip / size
        ahead = float(along @ heading)
        if ahead < 0:
            along = -along
        if abs(ahead) > TURNED:
            heading[:] = along
        return along

    def along_grip(self, v: Array, W: Array, heading: Array, still: float) -> tuple[Array, float]:
        """Return e (nv,) and e . v of a sliding no-slip contact, see `along`."""
        e = self.pair.torque(W[:, self.grip] @ self.along(v, W, heading, still))
        return e, float(e @ v)

    def slip(self, v: Array, w: Array) -> tuple[Array, float]:
        """Return e (nv,) and e . v where kinematics are current; w (6, m) are the wrenches of the rows."""
        S = self.lever(w)
        slip = S @ v
        e = S[0] if len(S) == 1 else S.T @ unit_direction(slip)
        return e, float(e @ v)

    def lever(self, w: Array) -> Array:
        """Return S (m, nv), slip = S v, where kinematics are current: m = 1 along an axis, otherwise 3."""
        return np.array([self.pair.torque(x) for x in self.slip_wrenches(w)])

    def slip_wrenches(self, w: Array) -> Array:
        """Return wrenches A (m, 6) on the second frame, S = A J, from those of the rows, w (6, r)."""
        pair, friction = self.pair, self.closure.friction
        if friction == "touches":
            n, p = w[:3, 0], self.point()
            ways = np.eye(3) - np.outer(n, n)
        else:
            ways, p = np.eye(3) if friction == "bears" else (pair.Ra @ self.axis)[None], pair.pb
        parts = (np.zeros(ways.shape), ways) if friction in TURNS else (ways, cross(p[:, None], ways.T).T)
        return np.concatenate(parts, axis=1)

    def core_data(self) -> dict[str, Any]:
        """Return the core data of the interface."""
        force = self.force
        return {
            "kind": "grips" if force.sticks else self.closure.friction,
            "row": self.rows.start,
            "components": self.rows.stop - self.rows.start,
            "grip": list(range(self.grip.start, self.grip.stop)) if force.sticks else [],
            "axis": self.axis.tolist(),
            "coefficient": force.coefficient * (force.radius or 1.0),
            "width": force.width,
        }

    @property
    def axis(self) -> Array:
        """Unit axis of the closure in the first frame, (3,); z where it has none."""
        return unit_axis(getattr(self.closure, "axis", None) or Z)

    def point(self) -> Array:
        """Contact point of the bodies, (3,)."""
        first = self.closure.primitives()[0]
        return first.lines(at_rest(self.pair)).p[:, 0] if isinstance(first, ContactHeightRow) else self.pair.pb


def unit_direction(x: Array) -> Array:
    """Unit vector along x; 0 for a zero vector."""
    return x / (np.sqrt(x @ x) + TINY)
