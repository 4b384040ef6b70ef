"""Reactions: forces and torques of closures, and efforts and powers of drivers, from multipliers."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...system import Array
from ...tolerances import VISIBLE
from ...units import quantity
from ..closures import independent_rows
from ..closures.brake import Brake
from ..closures.driver import Driver
from ..closures.unilateral_constraint import Stop
from ..tree.frames import skew

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

SAMPLES = 8
NOT_UNIQUE = "rows depend on others: the multipliers of minimum norm are shown"


@dataclass(frozen=True)
class Reaction:
    """Reaction force and torque of a closure on the body of its second frame, at that frame's origin.

    The opposite force and torque act on the body of the first frame at the same point.

    Attributes:
        name: name of the closure or driver.
        t: times in s, (n,).
        force: force in N, along the axes of the first frame, (n, 3).
        torque: torque in N m, along the axes of the first frame, (n, 3).
        force_world: force in N, along the world's axes, (n, 3).
        torque_world: torque in N m, along the world's axes, (n, 3).
        unique: which of the six components, force and then torque in the first frame, the motion determines.
    """

    name: str
    t: Array
    force: Array
    torque: Array
    force_world: Array
    torque_world: Array
    unique: tuple[bool, ...]

    def __str__(self) -> str:
        largest = [float(np.linalg.norm(x, axis=1).max(initial=0.0)) for x in (self.force, self.torque)]
        force, torque = quantity(largest[0], "N", ".4g"), quantity(largest[1], "N m", ".4g")
        lines = [f"reaction of {self.name}: force up to {force}, torque up to {torque}"]
        names = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
        if ambiguous := [name for name, unique in zip(names, self.unique, strict=True) if not unique]:
            lines.append(f"  not unique: {', '.join(ambiguous)} ({NOT_UNIQUE})")
        return "\n".join(lines)


@dataclass(frozen=True)
class Effort:
    """Effort of a coupling or a driver, and the power of a driver; or friction of a joint, and its power.

    Attributes:
        name: name of the coupling, driver or friction.
        t: times in s, (n,).
        effort: effort on the first joint, in N m or N; for a driven distance, the force in N that increases it, (n,).
        counter: effort on the second joint if there is one, in N m or N, (n,).
        position: u(t) of a driver in rad or m, zero for a coupling, (n,).
        power: effort times u'(t), or friction times the velocity of its joint, in W, (n,).
        unique: whether the motion determines it.
    """

    name: str
    t: Array
    effort: Array
    counter: Array | None
    position: Array
    power: Array
    unique: bool

    def __str__(self) -> str:
        effort, power = (float(np.abs(x).max(initial=0.0)) for x in (self.effort, self.power))
        text = f"effort of {self.name}: up to {effort:.4g} N m or N, power up to {quantity(power, 'W', '.4g')}"
        return text if self.unique else f"{text}\n  not unique ({NOT_UNIQUE})"


def reaction(mech: "Mechanism", name: str, t: Array, q: Array, lam: Array, v: Array | None = None) -> Reaction:
    """Return the reaction of a closure between frames, including its friction, or of a driven distance.

    Args:
        mech: the mechanism.
        name: name of the closure or driver.
        t: times, (n,).
        q: configurations, (n, nq).
        lam: multipliers, (n, ng).
        v: velocities, (n, nv), on which closure friction depends; at rest if omitted.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for a coupling, or a driver of joints: they have an effort.
    """
    rows = mech.rows_of(name)
    with mech.workspaces.borrowed() as system:
        bound = system.constraints.frame_rows.get(name)
        if bound is None:
            raise InputError(f"{name!r} connects joints and has no force at a point: use its effort")
        wrench, rotations = np.empty((len(t), 6)), np.empty((len(t), 3, 3))
        row_wrenches = np.empty((len(t), 6, len(rows)))
        for i in range(len(t)):
            system.closures(q[i], t[i])
            W = system.constraints.W[:, rows].copy()
            W[3:] -= (lever := skew(bound.pair.pb)) @ W[:3]
            row_wrenches[i], wrench[i], rotations[i] = W, W @ lam[i, rows], bound.pair.Ra
            if v is not None and system.closure_friction.regularized_interfaces(name):
                friction = system.closure_friction.wrench(name, v[i], lam[i])
                wrench[i] += friction
                wrench[i, 3:] -= lever @ friction[:3]
        unique = np.ones(6, bool)
        for i in sample_indices(len(t)):
            N = multiplier_null_space(system, t[i], q[i])[rows]
            R = np.kron(np.eye(2), rotations[i].T)
            unique &= np.abs(R @ row_wrenches[i] @ N).max(axis=1, initial=0.0) < VISIBLE
    force, torque = wrench[:, :3], wrench[:, 3:]
    local = [np.einsum("nji,nj->ni", rotations, x) for x in (force, torque)]
    return Reaction(name, np.asarray(t), local[0], local[1], force, torque, tuple(unique.tolist()))


def effort(mech: "Mechanism", name: str, t: Array, q: Array, lam: Array, v: Array) -> Effort:
    """Return the effort of a coupling, a driver or a stop, or the friction of a joint; arguments as for `reaction`.

    Both limits of a stop act along the same coordinate: its effort is their sum.

    Raises:
        UnknownNameError: for an unknown name.
        InputError: for a closure between frames, which has a reaction, or for several rows of a function.
    """
    rows, spec = mech.rows_of(name), next(c for c in mech.constraints if c.name == name)
    _require_effort(spec, name)
    row, force = rows.start, lam[:, rows].sum(axis=1)
    with mech.workspaces.borrowed() as system:
        bound: Any = next((r for r in system.constraints.joint_rows if r.at == row), None)
        second = bound.columns[1] if bound and len(bound.columns) > 1 else None
        u, counter = np.empty((len(t), 3)), np.zeros(len(t))
        for i in range(len(t)):
            G = system.closures(q[i], t[i])[1]
            u[i] = system.constraints.motion(t[i])[:, row]
            counter[i] = force[i] * G[row, second] if second is not None else 0.0
        null_spaces = (multiplier_null_space(system, t[i], q[i]) for i in sample_indices(len(t)))
        unique = all(np.abs(N[rows]).max(initial=0.0) < VISIBLE for N in null_spaces)
    speed = v[:, bound.columns[0]] if isinstance(spec, Brake) else u[:, 1]
    return Effort(name, np.asarray(t), force, None if second is None else counter, u[:, 0], force * speed, bool(unique))


def _require_effort(spec: Any, name: str) -> None:
    if not isinstance(spec, Driver) and spec.frames:
        raise InputError(f"{name!r} connects frames: use its reaction")
    if spec.m > 1 and not isinstance(spec, Stop):
        raise InputError(f"{name!r} has {spec.m} rows, each with a multiplier: lam.{name}.1, ...")


def redundant(mech: "Mechanism", t: float, q: Array) -> dict[str, int]:
    """Return closures and drivers with non-unique reactions, and the number of their redundant rows.

    Of m active rows, m - (rank of all rows - rank without these rows) are redundant; rows of open contacts are
    inactive. Trivial rows, such as the out-of-plane row of a planar loop, also count.
    """
    with mech.workspaces.borrowed() as system:
        G, inactive = mass_scaled_jacobian(system, t, q), system.constraints.inactive
    r, out = rank(G), {}
    for c in mech.constraints:
        rows = mech.rows_of(c.name)
        out[c.name] = len(np.setdiff1d(rows, inactive)) - (r - rank(np.delete(G, rows, axis=0)))
    return {name: n for name, n in out.items() if n}


def mass_scaled_jacobian(system: "Index2System", t: float, q: Array) -> Array:
    """Return G M^-1/2 of all rows, (ng, nv)."""
    return independent_rows.mass_scaled(system.inertia(t, q), system.jacobian()).T


def rank(G: Array) -> int:
    """Return the rank of scaled rows by pivoted QR, as in `mbdae.mechanism.closures.independent_rows`."""
    return independent_rows.rank(independent_rows.pivots(G.T)[1]) if len(G) else 0


def multiplier_null_space(system: "Index2System", t: float, q: Array) -> Array:
    """Return the null space of G^T: N (ng, n - r), G^T N = 0, N^T N = 1, of n active rows, r the rank in use."""
    U, G = system.inertia(t, q), system.jacobian()
    r, active = len(system.select_independent_rows(t, U, G)), np.delete(np.arange(len(G)), system.constraints.inactive)
    N = np.zeros((len(G), len(active) - r))
    N[active] = np.linalg.svd(G[active])[0][:, r:]
    return N


def sample_indices(n: int) -> Array:
    """Return at most eight of n indices, evenly spaced."""
    return np.unique(np.linspace(0, n - 1, min(n, SAMPLES)).astype(int))
