"""Rolling contacts: contact point, contact force and required friction."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import UnknownNameError
from ...system import Array
from ...tolerances import VISIBLE
from ...units import displayed, quantity
from ..closures.contact import ContactHeightRow, ConvexBody, NoSlipRows
from ..closures.kinds.rolling import RollingClosure
from ..closures.line_rows import with_zero_velocity
from .reactions import NOT_UNIQUE, multiplier_null_space, sample_indices

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

FORCES = ("normal", "longitudinal", "lateral")


@dataclass(frozen=True)
class Contact:
    """Contact force on a rolling body: normal, longitudinal (forwards) and lateral (to the left).

    Attributes:
        name: name of the closure.
        t: times in s, (n,).
        normal: normal force N in N, positive in compression, (n,); nan if joints keep the body on the surface.
        longitudinal: force forwards along the heading, in N, (n,).
        lateral: force to the left, in N, (n,).
        point: contact point in the world in m, (n, 3).
        unique: which of the three forces the motion determines.
    """

    name: str
    t: Array
    normal: Array
    longitudinal: Array
    lateral: Array
    point: Array
    unique: tuple[bool, bool, bool]

    @property
    def friction(self) -> Array:
        """Friction coefficient required not to slip, |F_t|/N, (n,); nan where N is not positive."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.normal > 0, np.hypot(self.longitudinal, self.lateral) / self.normal, np.nan)

    @property
    def lifts_off(self) -> float | None:
        """First time in s at which N is negative, so that the contact would separate; None if there is none."""
        return first_negative(self.t, self.normal)

    def __str__(self) -> str:
        low, high = (
            float(f(self.normal)) if np.isfinite(self.normal).any() else np.nan for f in (np.nanmin, np.nanmax)
        )
        friction = float(np.nanmax(self.friction)) if np.isfinite(self.friction).any() else np.nan
        ahead, left = (float(np.abs(x).max(initial=0.0)) for x in (self.longitudinal, self.lateral))
        lines = [
            f"contact {self.name}: N {displayed(low, 'N')[0]:.4g} to {quantity(high, 'N', '.4g')}, "
            f"ahead up to {quantity(ahead, 'N', '.4g')}, to the left up to {quantity(left, 'N', '.4g')}, "
            f"friction needed {friction:.3g}"
        ]
        if self.lifts_off is not None:
            lines.append(f"  N is negative from t = {quantity(self.lifts_off, 's')}: it would separate")
        if ambiguous := [name for name, unique in zip(FORCES, self.unique, strict=True) if not unique]:
            lines.append(f"  not unique: {', '.join(ambiguous)} ({NOT_UNIQUE})")
        return "\n".join(lines)


def first_negative(t: Array, x: Array) -> float | None:
    """Return the first time at which a sampled function (n,) is significantly negative, by linear interpolation."""
    negative = np.flatnonzero(x < -VISIBLE * np.fmax.reduce(np.abs(x), initial=0.0))
    if not len(negative):
        return None
    i = int(negative[0])
    if not i or np.isnan(x[i - 1]):
        return float(t[i])
    before = max(x[i - 1], 0.0)
    return float(t[i - 1] + (t[i] - t[i - 1]) * before / (before - x[i]))


def rolling_closures(mech: "Mechanism") -> list[RollingClosure]:
    """Return the rolling closures."""
    return [c for c in mech.closures if isinstance(c, RollingClosure)]


def rolling_body(mech: "Mechanism", name: str) -> ConvexBody:
    """Return body and surface of a rolling closure.

    Raises:
        UnknownNameError: lists the names of rolling closures.
    """
    for closure in rolling_closures(mech):
        if closure.name == name:
            return closure.shape
    raise UnknownNameError("rolling closure", name, [c.name for c in rolling_closures(mech)])


def contact(mech: "Mechanism", name: str, t: Array, q: Array, lam: Array) -> Contact:
    """Return the contact force of a rolling closure, and the contact point.

    Args:
        mech: the mechanism.
        name: name of the closure.
        t: times, (n,).
        q: configurations, (n, nq).
        lam: multipliers, (n, ng).

    Raises:
        UnknownNameError: if the name does not belong to a rolling closure.
        StepError: if a wheel lies flat.
    """
    points = contact_path(mech, name, q)
    system, rows = mech.system(), mech.rows_of(name)
    to_force = contact_force_map(system, name)
    force = np.asarray(lam)[:, rows] @ to_force.T
    if not to_force[0].any():
        force[:, 0] = np.nan
    unique = np.ones(3, bool)
    for i in sample_indices(len(t)):
        ambiguity = to_force @ multiplier_null_space(system, t[i], q[i])[rows]
        unique &= np.abs(ambiguity).max(axis=1, initial=0.0) < VISIBLE
    normal, longitudinal, lateral = force.T
    flags = bool(unique[0]), bool(unique[1]), bool(unique[2])
    return Contact(name, np.asarray(t), normal, longitudinal, lateral, points, flags)


def contact_force_map(system: "Index2System", name: str) -> Array:
    """Return the map from multipliers of a rolling closure to normal, longitudinal and lateral force, (3, m)."""
    span = system.constraints.spans[name]
    out = np.zeros((3, span.stop - span.start))
    for rows, kind, _ in system.constraints.frame_rows[name].rows:
        at = slice(rows.start - span.start, rows.stop - span.start)
        if isinstance(kind, ContactHeightRow):
            out[0, at] = 1.0
        elif isinstance(kind, NoSlipRows):
            out[1:, at] = kind.directions
    return out


def contact_path(mech: "Mechanism", name: str, q: Array) -> Array:
    """Return the contact points of a rolling body at configurations q (n, nq), in the world in m, (n, 3).

    Raises:
        UnknownNameError: if the name does not belong to a rolling closure.
        StepError: if a wheel lies flat.
    """
    body, system = rolling_body(mech, name), mech.system()
    pair = system.constraints.frame_rows[name].pair
    out = np.empty((len(q), 3))
    for i, configuration in enumerate(q):
        system.jacobian(configuration)
        out[i] = body.contact_kinematics(with_zero_velocity(pair)).p[:, 0]
    return out
