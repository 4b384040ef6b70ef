"""Step of the variational integrator RATTLE for a mechanism, on any configuration manifold.

The discrete Lagrangian of the trapezoidal rule in the coordinates x of a step, q_1 = q_0 (+) x, w = x/h,

    L_d = h/2 [L(q_0, w) + L(q_1, w)],   L(q, w) = w^T M(q) w/2 - U(q),

has the discrete equations of motion, with J = J(x), J(x) x = x, and d log(q_0^-1 q_1) = J(x) eta_1 - J(-x) eta_0,

    J(-x)^T (M_0 + M_1)/2 w - h/2 (D(q_0, w) + G_0^T lam) = M_0 v_0,   0 = g(t_1, q_1),
    M_1 v_1 = J(x)^T (M_0 + M_1)/2 w + h/2 (D(q_1, w) + G_1^T mu),     0 = G_1 v_1 + g_t(t_1),

where D(q, w) = d(w^T M w/2 - U)/dq + tau = N^T w/2 + tau - gravity and N(q, w) = d(M w)/dq, both in the tangent. The
step is symmetric: a step -h from (q_1, v_1) returns to (q_0, v_0), with lam and mu exchanged. Without friction and
damping it is symplectic. lam and mu approximate the multipliers at the start and at the end, of order 1. The work is
integrated by the trapezoidal rule, with the power at both ends.

Source: Leimkuhler, Reich, Simulating Hamiltonian Dynamics (2004), chapter 7; Hairer, Lubich, Wanner, Geometric
Numerical Integration, sections VI.6 and VII.1; Celledoni, Marthinsen, Owren, J. Comput. Phys. 257 (2014), for J.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....linear_solve import factorized
from ....system import Array
from ...tree.manifold import Manifold
from ...tree.tree_terms import bias, update_poses

if TYPE_CHECKING:
    from ..index2 import Index2System


class EndpointTerms(NamedTuple):
    """Terms at an end of a step: M, N (nv, nv), D (nv,), its partials with respect to w (nv, nv), and the power."""

    M: Array
    N: Array
    D: Array
    dD_dw: Array
    power: float


class RattleStep:
    """Step from (t, y) to t + h with fixed rows; the unknowns are x (nv,) and lam (r,)."""

    def __init__(self, system: "Index2System", t: float, h: float, y: Array, rows: Array) -> None:
        self.system, self.t, self.h, self.y, self.rows = system, t, h, y, rows
        self.q, self.v = system.split(y)
        self.M = system.inertial.momentum_partials(self.q, self.v)[0].copy()
        self.G = system.jacobian(self.q)[rows]

    def first_guess(self) -> tuple[Array, Array]:
        """Return x of constant velocity, and lam = 0: the equations are linear in lam."""
        return self.h * self.v, np.zeros(len(self.rows))

    def correction(self, x: Array, lam: Array) -> tuple[Array, Array]:
        """Return the changes of x and lam by Newton's method, with exact partials.

        Raises:
            StepError: if its matrix is singular.
        """
        s, m, h, nv, w = self.system, self.system.manifold, self.h, self.system.nv, x / self.h
        start, unit = self._endpoint_terms(self.t, self.q, w), np.eye(nv)
        M, N = (a.copy() for a in s.inertial.momentum_partials(m.integrate(self.q, x), w))
        g, G = s.closures(m.integrate(self.q, x), self.t + h)
        mean, back, to_v = (self.M + M) / 2, m.tangent(-x, unit), m.velocity(x, unit)
        upper = back.T @ (mean / h + N @ to_v / 2) + _transported_momentum_partials(m, x, mean @ w) - start.dD_dw / 2
        residual = self.M @ self.v - back.T @ (mean @ w) + h / 2 * (start.D + lam @ self.G)
        Gx = G[self.rows] @ to_v
        matrix = np.block([[h * upper, -self.G.T], [Gx, np.zeros((len(Gx), len(Gx)))]])
        s.counts.factorizations += 1
        s.counts.solves += 1
        solve = factorized(matrix, f"the linear system of a variational step at t = {self.t:.17g}")
        u = solve(np.concatenate([h * residual, -g[self.rows]]))
        return u[:nv], 2 / h**2 * u[nv:]

    def measure(self, dx: Array, x: Array) -> tuple[float, float]:
        """Return the largest components of dx and of q, both relative to the largest component of x."""
        mech = self.system.mechanism
        size = float(np.abs(x / mech.coordinate_scales).max()) + np.finfo(float).tiny
        return (
            float(np.abs(dx / mech.coordinate_scales).max()) / size,
            (1 + float(np.abs(self.q / mech.q_scales).max())) / size,
        )

    def end(self, x: Array, lam: Array) -> tuple[Array, Array]:
        """Return the displacement of y, (ny,), and mu of all rows, (ng,)."""
        s, h, w = self.system, self.h, x / self.h
        t, q = self.t + h, s.manifold.integrate(self.q, x)
        start, end = self._endpoint_terms(self.t, self.q, w), self._endpoint_terms(t, q, w)
        U, G = s.inertia(t, q), s.jacobian()
        J, used = s.manifold.tangent(x, np.eye(s.nv)), G[self.rows]
        momentum = J.T @ ((self.M + end.M) @ w) / 2 + h / 2 * end.D
        v, impulse = s.solve_saddle_point(t, U, used, used, momentum, -s.g_t(t)[self.rows])
        mu = 2 / h * impulse
        s._last_q, s._last = q, (U, G)
        power = start.power + end.power
        if s.driven:
            power -= lam @ s.g_t(self.t)[self.rows] + mu @ s.g_t(t)[self.rows]
        return np.concatenate([x, v - self.v, [h / 2 * power]]), s.all_multipliers(U, G, self.rows, mu)

    def _endpoint_terms(self, t: float, q: Array, w: Array) -> EndpointTerms:
        s, none = self.system, np.empty(0)
        s.counts.M += 1
        M, N = (a.copy() for a in s.inertial.momentum_partials(q, w))
        update_poses(s.model, s.workspace, q)
        tau, rates = s.generalized_force(t, q, w, none)
        dD_dw = N.T + s.laws.partials(t, q, w, none)[: s.nv, s.nv :]
        D = N.T @ w / 2 + tau - bias(s.model, s.workspace, q, np.zeros(s.nv))
        return EndpointTerms(M, N, D, dD_dw, float(rates[-1]))


def variational_step(system: "Index2System", t: float, h: float, y: Array) -> RattleStep:
    """Return a step of RATTLE from (t, y)."""
    return RattleStep(system, t, h, y, system.rows_of_step(t, y))


def _transported_momentum_partials(manifold: Manifold, x: Array, p: Array) -> Array:
    """Return d(J(-x)^T p)/dx for a constant p, (nv, nv)."""
    unit = np.eye(len(p))
    out = np.zeros_like(unit)
    for _, s, _, _ in manifold.group_joints:
        for j in range(s.start, s.stop):
            out[:, j] = manifold.tangent_rate(-x, -unit[j], unit).T @ p
    return out
