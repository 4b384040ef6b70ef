"""Friction proportional to constraint forces: T_k = -mu_k r_k |F_k(lam)| d_k along e_k, for each friction interface k.

e_k (nv,) is the generalized direction of the slip, e_k . v its speed, d_k its regularized sign, between -1 and 1. Each
stage, and each evaluation of the hidden constraint, solves

    M v' = f + G^T lam + sum_k e_k T_k,   Ghat v' = rhs,   T_k = -mu_k r_k |F_k(lam)| d_k

v' and lam are affine in T, with coefficients from one factorization; the remaining small system T = F(T) is solved by
Newton's method. The solution is unique if det(1 - dF/dT) > 0 everywhere; otherwise friction jams (Painleve paradox).

Source: F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts (1996), chapter 5; E. Hairer, C. Lubich,
M. Roche, LNM 1409 (1989), section 7, for y' = f(y, z) with a general f.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...data_types import CoreData
from ...errors import InputError, StepError, UnknownNameError
from ...system import Array
from ...tolerances import ROUNDING, SOLUTION_ROUNDING, TINY, ZERO_SPEED
from ..closures.closure import KINDS, Closure
from ..closures.constraints import Constraints
from ..closures.independent_rows import minimum_norm
from ..closures.kinds.rolling import RollingClosure
from ..forces.coulomb_friction import CoulombFriction
from .friction_interface import CLEAR_SLIP, ROTATIONAL, FrictionInterface, unit_direction

if TYPE_CHECKING:
    from .index2 import Index2System

ITERATIONS = 50


class ClosureFriction:
    """Friction interfaces of a workspace, whose friction depends on multipliers.

    Args:
        forces: force elements of the mechanism.
        closures: closures of the mechanism.
        constraints: rows of the mechanism in the workspace.

    Attributes:
        min_slip_speed: speed in m/s below which the slip direction is undefined.
        active: 1 for interfaces that slide, (k,), shared with the core.
        slip_directions: slip directions along no-slip rows, (k, 2), shared with the core; ``directions`` are views of
            the components in use.

    Raises:
        UnknownNameError: for a closure that does not exist.
        InputError: for a closure that neither rotates nor slides, or for an invalid radius.
    """

    def __init__(self, forces: tuple, closures: tuple[Closure, ...], constraints: Constraints) -> None:
        named, self.constraints, self.min_slip_speed = {c.name: c for c in closures}, constraints, ZERO_SPEED
        self.interfaces: list[FrictionInterface] = []
        for force in forces:
            if isinstance(force, CoulombFriction):
                if force.closure not in named:
                    raise UnknownNameError("closure", force.closure, named)
                closure = named[force.closure]
                _require_supported(force, closure)
                pair, start = constraints.frame_rows[closure.name].pair, constraints.spans[closure.name].start
                rows, no_slip = slice(start, start + closure.normal_force_rows), slice(start + 1, start + closure.m)
                self.interfaces.append(FrictionInterface(force, closure, pair, rows, no_slip))
        self.coefficient = np.array([p.force.coefficient * (p.force.radius or 1.0) for p in self.interfaces])
        self.active = np.array([not p.force.is_exact for p in self.interfaces], np.uint8)
        self.slip_directions = np.empty((len(self.interfaces), 2))
        self.reset()
        sizes = [p.no_slip_rows.stop - p.no_slip_rows.start for p in self.interfaces]
        self.directions = [x[:n] for x, n in zip(self.slip_directions, sizes, strict=True)]

    def reset(self) -> None:
        """Reset the slip directions."""
        if self.interfaces:
            self.slip_directions[:] = [1.0, 0.0]

    def __bool__(self) -> bool:
        return bool(self.interfaces) and bool(self.active.any())

    @property
    def can_stick(self) -> bool:
        """Whether any sliding interface can stick."""
        return any(active and p.force.is_exact for active, p in zip(self.active, self.interfaces, strict=True))

    def core_data(self) -> list[CoreData]:
        """Return the core data of the interfaces; `active` and `slip_directions` are shared with the core."""
        return [p.core_data() for p in self.interfaces]

    def slip_terms(self, v: Array, *, within_step: bool = True) -> tuple[Array, Array, Array]:
        """Return e (k, nv), e . v (k,) and the factors -mu r d (k,). Kinematics and G must be current."""
        W, k = self.constraints.W, len(self.interfaces)
        e, speed, d = np.zeros((k, len(v))), np.zeros(k), np.zeros(k)
        for i, p in enumerate(self.interfaces):
            if p.force.is_exact and self.active[i]:
                direction = p.slip_direction(v, W, self.directions[i], self.min_slip_speed, within_step)
                e[i], d[i] = p.pair.generalized_force(W[:, p.no_slip_rows] @ direction), 1.0
                speed[i] = e[i] @ v
            elif self.active[i]:
                e[i], speed[i] = p.slip(v, W[:, p.rows])
                d[i] = np.tanh(speed[i] / p.force.width)
        return e, speed, -self.coefficient * d

    def minimum_norm_map(self, rows: Array) -> Array:
        """Return the map (ng, r) from multipliers in use to those of all rows; kinematics must be current."""
        ng, r = self.constraints.ng, len(rows)
        if r == ng - len(self.constraints.inactive):
            return np.eye(ng)[:, rows]
        G = self.constraints.jacobian()
        return minimum_norm(G, r, G[rows]).T

    def regularized_interfaces(self, name: str) -> list[int]:
        """Return the indices of a closure's interfaces with regularized friction, which has no multiplier."""
        return [k for k, p in enumerate(self.interfaces) if p.closure.name == name and not p.force.is_exact]

    def wrench(self, name: str, v: Array, lam: Array) -> Array:
        """Return the regularized friction wrench of a closure on its second frame, about the world's origin, (6,).

        Args:
            name: name of the closure.
            v: velocity, (nv,).
            lam: multipliers of all rows, (ng,).
        """
        out = np.zeros(6)
        for k in self.regularized_interfaces(name):
            p = self.interfaces[k]
            A = p.slip_wrenches(self.constraints.W[:, p.rows])
            slip, F = A @ p.pair.relative(v), lam[p.rows]
            friction = self.coefficient[k] * np.sqrt(F @ F) * np.tanh(np.sqrt(slip @ slip) / p.force.width)
            out -= friction * (A.T @ unit_direction(slip))
        return out

    @property
    def planar_slips(self) -> list[int]:
        """Indices of sliding interfaces whose slip has two components: its direction changes within a mode."""
        found = np.flatnonzero(self.active).tolist() if self.interfaces else []
        return [k for k in found if self.interfaces[k].force.is_exact and len(self.directions[k]) > 1]

    def reject_planar_slips(self, what: str) -> None:
        """Raise an InputError if an interface slides in two directions: its friction has no partial derivatives."""
        if planar := self.planar_slips:
            name = self.interfaces[planar[0]].closure.name
            raise InputError(f"closure {name!r} slides in two directions: no derivative of {what}")

    def begin_step(self, v: Array) -> None:
        """Restore slip directions, which rejected steps may have reversed, to the slips at the start of a step.

        Kinematics must be current.
        """
        which = self.planar_slips
        self.constraints.update_wrenches([self.interfaces[k].closure.name for k in which])
        for k in which:
            slip, size = self.interfaces[k].no_slip_velocity(v, self.constraints.W)
            if self.is_resolved(size) and slip @ self.directions[k] < 0:
                self.directions[k][:] = slip / size

    def update_slip_directions(self, v: Array) -> bool:
        """Update the slip directions of sliding interfaces; return False if one is at rest. W must be current."""
        moving = True
        for k in np.flatnonzero(self.active).tolist():
            if (p := self.interfaces[k]).force.is_exact:
                slip, size = p.no_slip_velocity(v, self.constraints.W)
                moving &= self.is_resolved(size)
                self.directions[k][:] = slip / size if self.is_resolved(size) else self.directions[k]
        return moving

    def is_resolved(self, speed: float) -> bool:
        """Return whether the slip direction is resolved: the slip speed exceeds rounding and the errors of the run."""
        return speed > CLEAR_SLIP * self.min_slip_speed

    def with_sliding_friction(self, v: Array, lam: Array) -> Array:
        """Return multipliers with -mu |F| d in the inactive no-slip rows of sliding interfaces, (ng,)."""
        out = lam.copy()
        for k in np.flatnonzero(self.active):
            if (p := self.interfaces[k]).force.is_exact:
                direction = p.slip_direction(v, self.constraints.W, self.directions[k], self.min_slip_speed, False)
                F = lam[p.rows]
                out[p.no_slip_rows] = -self.coefficient[k] * np.sqrt(F @ F) * direction
        return out

    def reject(self, what: str) -> None:
        """Raise if there is friction: an analysis does not support forces that depend on multipliers.

        Raises:
            InputError: names the first closure with friction.
        """
        if self.interfaces:
            name = self.interfaces[0].closure.name
            raise InputError(f"{what} does not support coulomb_friction, of closure {name!r}")

    def normal_forces(self, lam: Array) -> tuple[Array, Array]:
        """Return |F| (k,) and its partial derivatives (k, ng) for multipliers of all rows, (ng,)."""
        size, gradient = np.zeros(len(self.interfaces)), np.zeros((len(self.interfaces), len(lam)))
        for k, p in enumerate(self.interfaces):
            F = lam[p.rows]
            size[k] = np.sqrt(F @ F)
            gradient[k, p.rows] = F / (size[k] + TINY)
        return size, gradient

    def solve(self, t: float, factor: Array, lam: Array, responses: Array) -> Array:
        """Return T (k,).

        Args:
            t: time, for messages.
            factor: -mu r d, (k,).
            lam: multipliers of all rows without friction, (ng,).
            responses: changes of these multipliers per unit of each T, (k, ng).

        Raises:
            StepError: if friction jams.
        """
        T, last = np.zeros(len(factor)), np.inf
        for _ in range(ITERATIONS):
            size, gradient = self.normal_forces(lam + T @ responses)
            partials = np.eye(len(T)) - factor[:, None] * (gradient @ responses.T)
            if not np.linalg.det(partials) > 0 or not (partials.diagonal() > 0).all():
                self._raise_jammed(t, partials)
            dT = np.linalg.solve(partials, factor * size - T)
            T, change = T + dT, float(np.abs(dT).max())
            size_T = np.abs(T).max()
            if change <= ROUNDING * size_T or (change >= 0.5 * last and change <= SOLUTION_ROUNDING * size_T):
                return T
            last = change
        active = (p for p, active in zip(self.interfaces, self.active, strict=True) if active)
        names = ", ".join(repr(p.closure.name) for p in active)
        raise StepError("friction", f"closures {names}: the iteration for friction does not converge at t = {t:.17g}")

    def _raise_jammed(self, t: float, partials: Array) -> None:
        name = self.interfaces[int(partials.diagonal().argmin())].closure.name
        text = f"friction jams closure {name!r} at t = {t:.17g}: it is so large that there is no motion, or several"
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
    """Return v' (nv,), lam (r,) of the rows in use, and the friction power in W, of a stage with friction.

    Args:
        s: the system.
        t: time.
        U: Cholesky factor of M at the stage.
        G: all rows at the stage, (ng, nv).
        rows: rows in use, (r,).
        Ghat: rows in use where the stage satisfies the constraint, (r, nv).
        f: other forces, (nv,).
        rhs: Ghat v', (r,).
        slips: result of `ClosureFriction.slip_terms` at the stage.
    """
    e, speed, factor = slips
    vdot, lam = s.solve_saddle_point(t, U, G[rows], Ghat, np.vstack([f, e]), rhs)
    all_lam = s.all_multipliers(U, G, rows, lam)
    T = s.closure_friction.solve(t, factor, all_lam[0], all_lam[1:])
    return vdot[0] + T @ vdot[1:], lam[0] + T @ lam[1:], float(T @ speed)


def _require_supported(force: CoulombFriction, closure: Closure) -> None:
    rolling = closure if isinstance(closure, RollingClosure) else None
    if not closure.friction or (rolling and rolling.contact is False):
        known = ", ".join(kind for kind, c in KINDS.items() if c.friction)
        raise InputError(f"coulomb_friction is for closures of kind {known}; {closure.name!r} is of another kind")
    _require_valid_grip(force, closure, rolling.no_slip_angles if rolling else ())
    rotates = closure.friction in ROTATIONAL
    if (force.radius is None) == rotates:
        expected = "needs the radius of its bearing" if rotates else "slides: radius does not belong to it"
        raise InputError(f"coulomb_friction {force.name!r}: closure {closure.name!r} {expected}")


def _require_valid_grip(force: CoulombFriction, closure: Closure, grips: Sequence[object]) -> None:
    """Check that the friction law applies to the no-slip rows of a closure."""
    if grips and not force.is_exact:
        how = "exact = true, or grip = 'none'"
        raise InputError(f"coulomb_friction {force.name!r}: the grip of {closure.name!r} needs {how}")
    if grips and closure.is_unilateral and (len(grips) > 1 or force.static is not None):
        how = "exact = true without static, and grip in one direction: 'longitudinal', 'lateral' or an angle"
        raise InputError(f"coulomb_friction {force.name!r}: {closure.name!r}, which is unilateral, needs {how}")
    if force.is_exact and not grips:
        raise InputError(f"coulomb_friction {force.name!r}: static and exact are for rolling closures with a grip")
