"""Step of a mechanism in index-2 form: each stage is a linear saddle-point system."""

from typing import TYPE_CHECKING

import numpy as np

from ....linear_solve import lapack
from ....system import Array
from .implicit_stage import ImplicitStages

if TYPE_CHECKING:
    from ..index2 import Index2System


class Index2Chart(ImplicitStages):
    """Step of a mechanism in coordinates (x, v, s, w), q = q_n (+) x, x' = J(x) v, with fixed rows."""

    def __init__(self, system: "Index2System", t: float, y: Array, rows: Array) -> None:
        self.system, self.t, self.y, self.rows = system, t, y, rows
        self.q, self.v = system.split(y)
        self.s = system.element_states(y)

    def first(self, carry: Array) -> tuple[Array, Array]:
        """Return the first stage (x', v', s', w') from `carry`, (nv + ns + 1,), x' = v, and no multipliers."""
        return np.concatenate([self.v, carry]), np.empty(0)

    def stage(self, t: float, x: Array, t_hat: float, xhat: Array, factor: float) -> tuple[Array, Array]:
        """Solve a saddle-point system with G at two configurations (Hairer, Wanner II, (VII.6.8))."""
        s, m, nv = self.system, self.system.manifold, self.system.nv
        q, v = m.integrate(self.q, x[:nv]), self.v + x[nv : 2 * nv]
        U, (f, rates) = s.inertia(t, q), s.force(t, q, v, self.s + x[2 * nv : -1])
        G = s.jacobian()
        slips = s.closure_friction.slip_terms(v) if s.closure_friction else None
        dx, Ghat = self.solve_stage(t_hat, x[:nv], v, xhat[:nv], factor, U, G)
        rate = Ghat.dot(self.v + xhat[nv : 2 * nv])
        if s.driven:
            rate += s.g_t(t_hat)[self.rows]
        vdot, lam = s.solve(t, U, G, self.rows, Ghat, f, rate / -factor, rates, slips)
        if s.driven:
            rates[-1] -= lam @ s.g_t(t)[self.rows]
        s._last_q, s._last = q, (U, G)
        return np.concatenate((dx, vdot, rates)), lam

    def solve_stage(
        self, t_hat: float, x: Array, v: Array, xhat: Array, factor: float, U: Array, G: Array
    ) -> tuple[Array, Array]:
        """Return x' = J(x) v (nv,), and G (r, nv) at q_n (+) (xhat + factor x'), where the stage constraint applies.

        U, and G over all rows, are evaluated at the stage.
        """
        m = self.system.manifold
        dx = m.tangent(x, v)
        return dx, self.system.jacobian(m.integrate(self.q, xhat + factor * dx)).take(self.rows, 0)

    def all_multipliers(self, z: Array) -> Array:
        """Return the multipliers of all rows at the configuration of the last stage."""
        s = self.system
        s.selection_trigger.probe(*s._last, self.rows)
        return s.all_multipliers(*s._last, self.rows, z)

    def point(self, x: Array) -> Array:
        """Return the state at tangent coordinates x of the step's start, whose rotations must be small."""
        self.system.manifold.require_small_rotations(x[: self.system.nv])
        return self.system.add(self.y, x)

    def project(self, e: Array) -> Array:
        """Project the velocities in e in the mass metric onto G v = 0 at the configuration of the last stage."""
        s, nv = self.system, self.system.nv
        if len(self.rows):
            e = e.copy()
            s.counts.projections += 1
            e[nv : 2 * nv] -= s._MinvGT.dot(lapack().dgesv(s._G.dot(s._MinvGT), s._G.dot(e[nv : 2 * nv]))[2])
        return e
