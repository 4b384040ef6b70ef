"""Residuals of implicit stages of a mechanism, and the linear systems of simplified Newton iterations.

In the coordinates (x, v, s, w) of a step, q = q_n (+) x, the residual of an implicit stage is

    J(x) v - x',   f(t, q, v, s) + G^T lam - M v',   h(t, q, v, s) - s',   power - w',   G v + g_t

with r independent rows of G.

In the linearized equations, with mu = h times an eigenvalue of the method's matrix, x' can be eliminated; a system of
size nv + ns + 1 + r remains. With u = (v, s, w), E = diag(M, 1) and G padded with zeros, it is, for vector spaces,

    [ E - mu D - mu^2 K   -L ] [du' ]       K = d(f + G^T lam - M v', h, power)/dq,  D = d(f, h, power)/du,
    [ G + mu B             0 ] [dlam]       L = d(G^T lam, 0, -g_t lam)/dlam,        B = d(G v)/dq

On manifolds x' = J(x) v, and a change of x is J times a tangent vector: K S J replaces K and B S J replaces B,
S = J^-1 (I - mu d(J v)/dx)^-1.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....linear_solve import factorized, lapack
from ....system import Array, Counts, Solver
from ...tree.manifold import Manifold
from ...tree.tree_terms import inverse_dynamics, update_poses
from ..equation_partials import EquationPartials, equation_partials

if TYPE_CHECKING:
    from ..index2 import Index2System


class ImplicitStages:
    """Implicit stages of a step of a mechanism."""

    system: "Index2System"
    t: float
    y: Array
    q: Array
    v: Array
    s: Array
    rows: Array

    @property
    def unknowns(self) -> tuple[int, ...]:
        """Rows whose multipliers are unknowns."""
        return tuple(self.rows.tolist())

    def start(self) -> tuple[Array, Array]:
        """Return (v, v', s', w') and the multipliers of the rows in use, (r,)."""
        F, z = self.system.derivative(self.t, self.y)
        lam = z[: self.system.ng]
        if len(self.rows) < len(lam):
            G = self.system.closures(self.q)[1]
            lam = np.linalg.lstsq(G[self.rows].T, G.T @ lam)[0]
        return F, lam

    def residual(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return the first four residuals above, (2 nv + ns + 1,), and -G v - g_t, (r,)."""
        s, nv = self.system, self.system.nv
        q, v = s.manifold.integrate(self.q, x[:nv]), self.v + x[nv : 2 * nv]
        update_poses(s.model, s.workspace, q)
        G = s.jacobian().take(self.rows, 0)
        tau, rates = s.generalized_force(t, q, v, self.s + x[2 * nv : -1])
        if s.closure_friction:
            e, speed, factor = s.closure_friction.slip_terms(v)
            T = factor * s.closure_friction.normal_forces(s.closure_friction.minimum_norm_map(self.rows) @ z)[0]
            tau, rates[-1] = tau + T @ e, rates[-1] + T @ speed
        inertial = inverse_dynamics(s.model, s.workspace, q, v, dx[nv : 2 * nv])
        constraint = G.dot(v)
        if s.driven:
            g_t = s.g_t(t)[self.rows]
            rates[-1] -= z.dot(g_t)
            constraint += g_t
        r = np.concatenate((s.manifold.tangent(x[:nv], v), tau + z.dot(G) - inertial, rates))
        r[:nv] -= dx[:nv]
        r[2 * nv :] -= dx[2 * nv :]
        return r, -constraint

    def linearize(self, x: Array, dx: Array, z: Array) -> "Linearized":
        """Return the partial derivatives at (x, x', z)."""
        s, nv = self.system, self.system.nv
        q, u = s.manifold.integrate(self.q, x[:nv]), self.y[s.nq :] + x[nv:]
        local = equation_partials(s, self.t, q, u, dx[nv : 2 * nv], z, self.rows)
        return Linearized(local, _tangent_map(s.manifold, x[:nv], u[:nv]), s.counts, self.t)

    def end(self, t: float, x: Array, dx: Array | None, z: Array) -> tuple[Array, Array]:
        """Return y and the multipliers of all rows, (ng,); the next step reuses the mass matrix and G.

        The remaining iteration error of z is |G - G_0| times its last change, much larger than the errors of x and x'.
        One linear solve removes it by minimizing |M^-1/2 (f + G^T z - M v')|. If bodies rotate far within a step,
        components excited by rounding converge slowly: the velocities in x are projected onto 0 = G v + g_t. Both are
        omitted without dx, when the step does not end at a stage.
        """
        s, nv, y = self.system, self.system.nv, self.system.add(self.y, x)
        q, _ = s.split(y)
        U, G = s.inertia(t, q), s.jacobian()
        s._last_q, s._last = q, (U, G)
        if dx is None:
            s.manifold.require_small_rotations(x[:nv])
            return y, s.all_multipliers(U, G, self.rows, z)
        residual, minus_rate = ImplicitStages.residual(self, t, x, dx, z)
        used = G[self.rows]
        X = lapack().dpotrs(U, np.column_stack([used.T, residual[nv : 2 * nv]]))[0]
        corrections = np.linalg.solve(used @ X[:, :-1], np.column_stack([used @ X[:, -1], minus_rate]))
        x[nv : 2 * nv] += X[:, :-1] @ corrections[:, 1]
        y = s.add(self.y, x)
        return y, s.all_multipliers(U, G, self.rows, z - corrections[:, 0])


def _tangent_map(manifold: Manifold, x: Array, v: Array) -> tuple[Array, Array]:
    """Return J(x) and d(J(x) v)/dx, (nv, nv) each."""
    unit = np.eye(len(v))
    if not manifold.group_joints:
        return unit, np.zeros(unit.shape)
    return manifold.tangent(x, unit), np.array([manifold.tangent_rate(x, e, v) for e in unit]).T


class Linearized(NamedTuple):
    """Partial derivatives of a mechanism at a point: `mbdae.system.Linearization`.

    Attributes:
        partials: partial derivatives of the equations of motion.
        tangent_map: J(x) and d(J(x) v)/dx, (nv, nv) each.
        counts: counters of the system.
        t: time, for messages.
    """

    partials: EquationPartials
    tangent_map: tuple[Array, Array]
    counts: Counts
    t: float

    def apply_E(self, e: Array) -> Array:
        """Return (e_x, E e_u)."""
        nv = len(self.tangent_map[0])
        return np.concatenate([e[:nv], self.partials.E @ e[nv:]])

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return E, (E f)_x, (E f)_z and g_x, see `mbdae.system.Linearization`."""
        (J, dJv), p = self.tangent_map, self.partials
        nv, n, r = len(J), len(p.E), len(p.G)
        inverse = np.linalg.inv(J)  # from x to the tangent at q
        E, A = np.eye(nv + n), np.zeros((nv + n, nv + n))
        E[nv:, nv:], A[:nv, :nv], A[:nv, nv : 2 * nv] = p.E, dJv, J
        A[nv:, :nv], A[nv:, nv:] = p.K @ inverse, p.D
        L = np.vstack([np.zeros((nv, r)), p.L])
        return E, A, L, np.hstack([p.B @ inverse, padded(p.G, n)])

    def solver(self, matrix: Array) -> Callable[[Array], Array]:
        """Factorize a matrix, count it, and return b -> matrix^-1 b."""
        self.counts.factorizations += 1
        return factorized(matrix, f"the linear system of an implicit step at t = {self.t:.17g}")

    def stage_blocks(self, mu: complex) -> tuple[Array, Array, Array, Array]:
        """Return S, mu K S, B S and the upper left block of the matrix above."""
        J, dJv = self.tangent_map
        S = np.linalg.inv((np.eye(len(J)) - mu * dJv).dot(J))
        KS = mu * self.partials.K.dot(S)
        upper = self.partials.E - mu * self.partials.D
        upper[:, : len(J)] -= mu * KS.dot(J)
        return S, KS, self.partials.B.dot(S), upper

    def factorize(self, mu: complex) -> Solver:
        """Factorize the matrix above, real or complex."""
        S, KS, BS, upper = self.stage_blocks(mu)
        G, (J, _) = self.partials.G, self.tangent_map
        n, nv = len(upper), len(J)
        matrix = np.zeros((n + len(G), n + len(G)), upper.dtype)
        matrix[:n, :n], matrix[:n, n:], matrix[n:, :nv] = upper, -self.partials.L, G + mu * BS.dot(J)
        solve_matrix = self.solver(matrix)

        def solve(r: Array, c: Array) -> tuple[Array, Array]:
            self.counts.solves += 1
            u = solve_matrix(np.concatenate((r[nv:] + KS.dot(r[:nv]), c / mu - BS.dot(r[:nv]))))
            return np.concatenate((J.dot(S.dot(r[:nv] + mu * J.dot(u[:nv]))), u[:n])), u[n:]

        return solve


def padded(G: Array, n: int) -> Array:
    """Return G (r, nv) padded on the right with columns of zeros, (r, n)."""
    return np.hstack([G, np.zeros((len(G), n - G.shape[1]))])
