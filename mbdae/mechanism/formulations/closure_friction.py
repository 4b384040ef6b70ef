"""Friction proportional to constraint forces: T_k = -mu_k r_k |F_k(lam)| d_k along e_k, for each friction interface k.

e_k (nv,) is the generalised direction of a slip at speed e_k . v; d_k is its sense, between -1 and 1. A stage, or a
point of the hidden constraint, solves

    M v' = f + G^T lam + sum_k e_k T_k,   Ghat v' = rhs,   T_k = -mu_k r_k |F_k(lam)| d_k

v' and lam are affine in T, with coefficients from the factors of one solve; the remaining small system for T is solved
by Newton's method. The solution is unique if det(1 - dT/dT) > 0 throughout; otherwise friction jams (Painleve paradox).

Source: F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts (1996), chapter 5; E. Hairer, C. Lubich,
M. Roche, LNM 1409 (1989), section 7, for y' = f(y, z) with a general f.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, StepError, UnknownNameError
from ...system import Array
from ...tolerances import ROUNDING, SOLUTION_ROUNDING, STILL, TINY
from ..closures.closure import Closure, kinds_of
from ..closures.constraints import Constraints
from ..closures.independent_rows import minimum_norm
from ..closures.kinds.rolling import RollingClosure
from ..forces.coulomb_friction import CoulombFriction
from .friction_interface import TURNS, FrictionInterface, unit_direction

if TYPE_CHECKING:
    from .index2 import Index2System

ITERATIONS = 50


class ClosureFriction:
    """Friction interfaces of a workspace whose friction depends on multipliers.

    Args:
        forces: force elements of the mechanism.
        closures: closures of the mechanism.
        constraints: rows of the mechanism in the workspace.

    Attributes:
        still: speed in m/s below which a slip has no direction.

    Raises:
        UnknownNameError: for a closure that does not exist.
        InputError: for a closure that neither rotates nor slides, or for an invalid radius.
    """

    def __init__(self, forces: tuple, closures: tuple[Closure, ...], constraints: Constraints) -> None:
        named, self.constraints, self.still = {c.name: c for c in closures}, constraints, STILL
        self.places: list[FrictionInterface] = []
        for force in forces:
            if isinstance(force, CoulombFriction):
                if force.closure not in named:
                    raise UnknownNameError("closure", force.closure, named)
                closure = named[force.closure]
                _refuse(force, closure)
                pair, start = constraints.frame_rows[closure.name].pair, constraints.spans[closure.name].start
                rows = slice(start, start + closure.load_rows)
                self.places.append(FrictionInterface(force, closure, pair, rows, slice(start + 1, start + closure.m)))
        self.coefficient = np.array([p.force.coefficient * (p.force.radius or 1.0) for p in self.places])
        self.active = np.array([not p.force.sticks for p in self.places], np.uint8)  # sticking does not slide
        self.slip_directions = np.tile([1.0, 0.0], (len(self.places), 1))
        self.heading = [x[: p.grip.stop - p.grip.start] for x, p in zip(self.slip_directions, self.places, strict=True)]

    def __bool__(self) -> bool:
        return bool(self.active.any())

    @property
    def can_stick(self) -> bool:
        """Return whether any interface can stick instead of sliding."""
        return any(active and place.force.sticks for active, place in zip(self.active, self.places, strict=True))

    def core_data(self) -> list[dict[str, Any]]:
        """Return the core data of the interfaces; `active` and `headings` are shared with the core."""
        return [place.core_data() for place in self.places]

    def slips(self, v: Array) -> tuple[Array, Array, Array]:
        """Return e (k, nv), e . v (k,) and the factors -mu r d (k,). Kinematics and G must be current."""
        W, k = self.constraints.W, len(self.places)
        e, speed, d = np.zeros((k, len(v))), np.zeros(k), np.zeros(k)
        for i, p in enumerate(self.places):
            if p.force.sticks and self.active[i]:
                (e[i], speed[i]), d[i] = p.along_grip(v, W, self.heading[i], self.still), 1.0
            elif self.active[i]:
                e[i], speed[i] = p.slip(v, W[:, p.rows])
                d[i] = np.tanh(speed[i] / p.force.width)
        return e, speed, -self.coefficient * d

    def minimum_norm_map(self, rows: Array) -> Array:
        """Return the matrix (ng, r) from multipliers in use to those of all rows. Kinematics and G must be current."""
        ng, r = self.constraints.ng, len(rows)
        if r == ng:
            return np.eye(ng)[:, rows]
        G = self.constraints.jacobian()
        return np.array([minimum_norm(G, r, g) for g in G[rows]]).T

    def regularised_interfaces(self, name: str) -> list[int]:
        """Return the indices of a closure's interfaces with regularised friction, which is not a multiplier."""
        return [k for k, p in enumerate(self.places) if p.closure.name == name and not p.force.sticks]

    def wrench(self, name: str, v: Array, lam: Array) -> Array:
        """Return the regularised friction wrench of a closure on its second frame, at the world's origin, (6,).

        Args:
            name: name of the closure.
            v: velocity, (nv,).
            lam: multipliers of all rows, (ng,).
        """
        out = np.zeros(6)
        for k in self.regularised_interfaces(name):
            place = self.places[k]
            A = place.slip_wrenches(self.constraints.W[:, place.rows])
            slip, F = A @ place.pair.relative(v), lam[place.rows]
            load = self.coefficient[k] * np.sqrt(F @ F) * np.tanh(np.sqrt(slip @ slip) / place.force.width)
            out -= load * (A.T @ unit_direction(slip))
        return out

    def update_slip_directions(self, v: Array) -> bool:
        """Update the slip directions of sliding interfaces; False if one of them is at rest. W must be current."""
        moving = True
        for k in np.flatnonzero(self.active):
            if (place := self.places[k]).force.sticks:
                slip = self.constraints.W[:, place.grip].T @ place.pair.relative(v)
                size = float(np.sqrt(slip @ slip))
                moving &= size > self.still
                self.heading[k][:] = slip / size if size > self.still else self.heading[k]
        return moving

    def filled(self, v: Array, lam: Array) -> Array:
        """Return multipliers with -mu |F| d in the inactive no-slip rows of sliding interfaces, (ng,)."""
        out = lam.copy()
        for k in np.flatnonzero(self.active):
            if (place := self.places[k]).force.sticks:
                along, F = place.along(v, self.constraints.W, self.heading[k], self.still), lam[place.rows]
                out[place.grip] = -self.coefficient[k] * np.sqrt(F @ F) * along
        return out

    def reject(self, what: str) -> None:
        """Raise for an analysis that does not support forces that depend on multipliers.

        Raises:
            InputError: naming the first friction.
        """
        if self.places:
            raise InputError(f"{what} does not know coulomb_friction, of closure {self.places[0].closure.name!r}")

    def carried(self, lam: Array) -> tuple[Array, Array]:
        """Return |F| (k,) and its partial derivatives (k, ng) for multipliers of all rows, (ng,)."""
        size, gradient = np.zeros(len(self.places)), np.zeros((len(self.places), len(lam)))
        for k, place in enumerate(self.places):
            F = lam[place.rows]
            size[k] = np.sqrt(F @ F)
            gradient[k, place.rows] = F / (size[k] + TINY)
        return size, gradient

    def solve(self, t: float, factor: Array, lam: Array, responses: Array) -> Array:
        """Return T (k,).

        t: time, for messages.
        factor: -mu r d, (k,).
        lam: multipliers of all rows without friction, (ng,).
        responses: changes of these multipliers per unit of each T, (k, ng).

        Raises:
            StepError: where friction jams.
        """
        T, last = np.zeros(len(factor)), np.inf
        for _ in range(ITERATIONS):
            size, gradient = self.carried(lam + T @ responses)
            partials = np.eye(len(T)) - factor[:, None] * (gradient @ responses.T)
            if not np.linalg.det(partials) > 0 or not (partials.diagonal() > 0).all():
                self._wedges(t, partials)
            move = np.linalg.solve(partials, factor * size - T)
            T, change = T + move, float(np.abs(move).max())
            size_T = np.abs(T).max()
            if change <= ROUNDING * size_T or (change >= 0.5 * last and change <= SOLUTION_ROUNDING * size_T):
                return T
            last = change
        names = ", ".join(repr(p.closure.name) for p, active in zip(self.places, self.active, strict=True) if active)
        raise StepError("friction", f"closures {names}: no friction was found that fits its own load at t = {t:.17g}")

    def _wedges(self, t: float, partials: Array) -> None:
        name = self.places[int(partials.diagonal().argmin())].closure.name
        text = f"friction wedges closure {name!r} at t = {t:.17g}: with so much of it there is no motion, or several"
        raise StepError("friction", text)


def solve_with_friction(
    s: "Index2System",
    t: float,
    U: Array,
    G: Array,
    rows: Array,
    Ghat: Array,
    f: Array,
    rhs: Array,
    slips: tuple[Array, Array, Array],
) -> tuple[Array, Array, float]:
    """Solve a stage with friction (see the module): v' (nv,), lam (r,) of the rows in use, and the friction power in W.

    Args:
        s: the system.
        t: time.
        U: Cholesky factor of M at the stage.
        G: all rows there, (ng, nv).
        rows: rows in use, (r,).
        Ghat: rows in use where the stage satisfies the constraint, (r, nv).
        f: other forces, (nv,).
        rhs: Ghat v', (r,).
        slips: result of `ClosureFriction.slips` at the stage.
    """
    e, speed, factor = slips
    vdot, lam = s.saddle(t, U, G[rows], Ghat, np.vstack([f, e]), rhs)
    whole: Callable[[Array], Array] = lambda x: s.all_multipliers(U, G, rows, x)  # noqa: E731
    T = s.sliding.solve(t, factor, whole(lam[0]), np.array([whole(x) for x in lam[1:]]))
    return vdot[0] + T @ vdot[1:], lam[0] + T @ lam[1:], float(T @ speed)


def _refuse(force: CoulombFriction, closure: Closure) -> None:
    rolling = closure if isinstance(closure, RollingClosure) else None
    if not closure.friction or (rolling and rolling.contact is False):
        known = ", ".join(kind for kind, c in kinds_of(Closure).items() if c.friction)
        raise InputError(f"coulomb_friction is for closures of kind {known}; {closure.name!r} is another")
    _require_valid_grip(force, closure, rolling.tangents if rolling else ())
    turns = closure.friction in TURNS
    if (force.radius is None) == turns:
        belongs = "needs the radius of its bearing" if turns else "slides: radius does not belong to it"
        raise InputError(f"coulomb_friction {force.name!r}: closure {closure.name!r} {belongs}")


def _require_valid_grip(force: CoulombFriction, closure: Closure, grips: Sequence[object]) -> None:
    """Require a law of friction that the no-slip rows of a closure can follow."""
    if grips and not force.sticks:
        how = "exact = true, or grip = 'none'"
        raise InputError(f"coulomb_friction {force.name!r}: the grip of {closure.name!r} needs {how}")
    if grips and closure.is_unilateral and (len(grips) > 1 or force.static is not None):
        how = "exact = true without static, and grip along one line: 'longitudinal', 'lateral' or an angle"
        raise InputError(f"coulomb_friction {force.name!r}: {closure.name!r}, which lets go, needs {how}")
    if force.sticks and not grips:
        raise InputError(f"coulomb_friction {force.name!r}: static and exact are for rolling closures with a grip")
