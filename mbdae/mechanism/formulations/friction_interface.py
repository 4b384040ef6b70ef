"""Friction interface of a closure: direction and speed of slip."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...data_types import CoreData
from ...system import Array
from ...tolerances import TINY, ZERO_SPEED
from ..closures.closure import Closure, Z
from ..closures.contact import ContactHeightRow
from ..closures.line_rows import with_zero_velocity
from ..closures.rows import unit_axis
from ..forces.coulomb_friction import CoulombFriction
from ..tree.frames import Pair, cross

if TYPE_CHECKING:
    from ..mechanism import Mechanism

ROTATIONAL = ("revolute", "spherical")  # friction torques, in a bearing with a radius
CLEAR_SLIP = 10.0  # multiple of the smallest slip speed, above which the slip direction is not due to rounding
SLIP_ERROR = 3.0  # multiple of rtol times the characteristic speed: errors of a run rotate slower slips
MIN_COSINE = 0.7  # cosine of the rotation of a slip direction within one step: below, it is not reliable


def smallest_slip(mechanism: "Mechanism", rtol: float) -> float:
    """Return the speed in m/s below which the slip direction is undefined in a run; ``rtol`` is 0 for a single point.

    A slip in two directions rotates towards the other forces at the rate F / (m |v|) before it comes to rest. Error
    control does not resolve this rotation where |v| is as small as the errors.
    """
    return max(ZERO_SPEED, SLIP_ERROR * rtol) * mechanism.characteristic_speed


class FrictionInterface(NamedTuple):
    """Friction interface between two bodies.

    Attributes:
        force: the friction force of the mechanism.
        closure: closure whose reaction causes the friction.
        pair: frames of the closure.
        rows: rows whose multipliers are the components of the reaction that causes the friction.
        no_slip_rows: no-slip rows that may slide.
    """

    force: CoulombFriction
    closure: Closure
    pair: Pair
    rows: slice
    no_slip_rows: slice

    def slip_direction(self, v: Array, W: Array, last: Array, min_speed: float, within_step: bool) -> Array:
        """Return the slip direction (m,) along inactive no-slip rows.

        Within a step, the last direction is updated, and continued if the slip passes zero, where the mode ends. At
        other points the direction is that of the slip, if it exceeds rounding.
        """
        slip, size = self.no_slip_velocity(v, W)
        if size <= min_speed:
            return last
        direction = slip / size
        if not within_step and size > CLEAR_SLIP * min_speed:
            return direction
        cosine = float(direction @ last)
        if cosine < 0:
            direction = -direction
        if within_step and abs(cosine) > MIN_COSINE:
            last[:] = direction
        return direction

    def no_slip_velocity(self, v: Array, W: Array) -> tuple[Array, float]:
        """Return the slip along no-slip rows, (m,), and its speed, from the wrenches W (6, ng) of all rows."""
        slip = W[:, self.no_slip_rows].T @ self.pair.relative(v)
        return slip, float(np.sqrt(slip @ slip))

    def slip(self, v: Array, w: Array) -> tuple[Array, float]:
        """Return e (nv,) and e . v at current kinematics; w (6, m) are the wrenches of the rows."""
        S = self.slip_jacobian(w)
        slip = S @ v
        e = S[0] if len(S) == 1 else S.T @ unit_direction(slip)
        return e, float(e @ v)

    def slip_jacobian(self, w: Array) -> Array:
        """Return S (m, nv), slip = S v, at current kinematics: m = 1 along an axis, otherwise 3."""
        return np.array([self.pair.generalized_force(x) for x in self.slip_wrenches(w)])

    def sliding_jacobian(self, W: Array) -> Array:
        """Return S (m, nv) of an interface that slides, from the wrenches W (6, ng) of all rows."""
        if self.force.is_exact:
            return np.array([self.pair.generalized_force(w) for w in W[:, self.no_slip_rows].T])
        return self.slip_jacobian(W[:, self.rows])

    def slip_wrenches(self, w: Array) -> Array:
        """Return wrenches A (m, 6) on the second frame, S = A J, from those of the rows, w (6, r)."""
        pair, friction = self.pair, self.closure.friction
        if friction == "surface":
            n, p = w[:3, 0], self.contact_point()
            e = np.eye(3) - np.outer(n, n)
        else:
            e, p = np.eye(3) if friction == "spherical" else (pair.Ra @ self.axis)[None], pair.pb
        blocks = (np.zeros(e.shape), e) if friction in ROTATIONAL else (e, cross(p[:, None], e.T).T)
        return np.concatenate(blocks, axis=1)

    def core_data(self) -> CoreData:
        """Return the core data of the interface."""
        force = self.force
        return {
            "kind": "rolling" if force.is_exact else self.closure.friction,
            "row": self.rows.start,
            "components": self.rows.stop - self.rows.start,
            "no_slip_rows": list(range(self.no_slip_rows.start, self.no_slip_rows.stop)) if force.is_exact else [],
            "axis": self.axis.tolist(),
            "coefficient": force.coefficient * (force.radius or 1.0),
            "width": force.width,
        }

    @property
    def axis(self) -> Array:
        """Unit axis of the closure in the first frame, (3,); z if it has none."""
        return unit_axis(getattr(self.closure, "axis", None) or Z)

    def contact_point(self) -> Array:
        """Return the contact point of the bodies, (3,)."""
        first = self.closure.primitives()[0]
        if isinstance(first, ContactHeightRow):
            return first.lines(with_zero_velocity(self.pair)).p[:, 0]
        return self.pair.pb


def unit_direction(x: Array) -> Array:
    """Return the unit vector along x; 0 for a zero vector."""
    return x / (np.sqrt(x @ x) + TINY)
