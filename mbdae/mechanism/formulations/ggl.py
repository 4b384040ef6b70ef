"""GGL stabilized index-2 form of a mechanism: a second multiplier enforces the position constraints.

    q' = v + M^-1 G_p^T mu,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = g(t, q),   0 = G(q) v + g_t(t)

G_p are the position rows, which have a g; velocity rows have no mu. On the exact solution mu = 0.

Source: Gear, Gupta, Leimkuhler, J. Comput. Appl. Math. 12 (1985); Hairer, Wanner II, (VII.1.51).
"""

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...linear_solve import lapack
from ...system import Array, Solver, State
from ...tolerances import ROUNDING, SAME_STATE, SEARCH_TOLERANCE
from ..closures import independent_rows
from ..closures.closure_error import largest_error, shortening_remark
from .index2 import Index2System
from .steps.implicit_stage import Linearized, padded
from .steps.index2_step import Index2Chart
from .steps.projection import contradicting_positions, project_velocity, require_compatible_velocities

if TYPE_CHECKING:
    from ..mechanism import Mechanism

ITERATIONS = 12


class GGLSystem(Index2System):
    """`mbdae.system.System` of a mechanism with both levels enforced: z = (lam, mu), (2 ng,), mu = 0 for velocity rows.

    mu belongs to the rows in use or, if there are velocity rows, to independent position rows. While the rank is
    constant, 0 = g on these rows describes the same configurations as on all rows; the other rows are checked.
    """

    formulation = "ggl"

    def __init__(self, mechanism: "Mechanism", **core: ModuleType) -> None:
        super().__init__(mechanism, **core)
        self.nz = 2 * self.ng
        self.velocity_correction = np.zeros(self.nv)  # M^-1 G_p^T mu at the last stage
        self.positional_rows = np.flatnonzero(mechanism.positional)
        self.position_rank: int | None = None  # rank of the position rows

    @property
    def features(self) -> dict[str, str]:
        """See `Index2System`, and ``"ggl"``."""
        return {"ggl": "formulation 'ggl'", **super().features}

    def chart(self, t: float, y: Array) -> "GGLChart":
        rows = super().chart(t, y).rows
        return GGLChart(self, t, y, rows, self.independent_position_rows(t, y, rows))

    def independent_position_rows(self, t: float, y: Array, rows: Array) -> Array:
        """Return independent position rows, (k,): the rows in use if all rows are position rows."""
        if len(self.positional_rows) == self.ng:
            return rows
        U, G = self.point(t, self.split(y)[0])
        order, diagonal = independent_rows.pivots(independent_rows.mass_scaled(U, G[self.positional_rows]))
        if self.position_rank is None:
            self.position_rank = independent_rows.rank(diagonal)
        return np.sort(self.positional_rows[order[: self.position_rank]])

    def all_position_multipliers(self, U: Array, G: Array, rows: Array, mu: Array) -> Array:
        """Return mu of all rows, (ng,), from mu of the independent position rows, (k,)."""
        out = np.zeros(self.ng)
        if len(rows) == len(self.positional_rows):
            out[rows] = mu
        else:
            within = np.searchsorted(self.positional_rows, rows)
            out[self.positional_rows] = independent_rows.all_multipliers(U, G[self.positional_rows], within, mu)
        return out

    def update_independent_rows(self, t: float, state: State) -> State:
        """See `Index2System`; also checks drivers against all velocity rows, since there is no projection.

        Raises:
            StepError: if velocities contradict each other.
        """
        state = super().update_independent_rows(t, state)
        if self.driven:
            q, v = self.split(state.y)
            U, G = self.point(t, q)
            require_compatible_velocities(self, t, G, project_velocity(self, t, U, G, v))
        return state

    def derivative(self, t: float, y: Array, guess: Array | None = None) -> tuple[Array, Array]:
        """Return (v, v', s', w') and (lam, mu = 0), (2 ng,), from the hidden constraint."""
        F, lam = super().derivative(t, y)
        self.velocity_correction = np.zeros(self.nv)
        return F, np.concatenate([lam, np.zeros(self.ng)])

    def carry(self, F: Array, z: Array) -> Array:
        """Return (M^-1 G_p^T mu, v', s', w'), (2 nv + ns + 1,)."""
        return np.concatenate([self.velocity_correction, F[self.nv :]])


class GGLChart(Index2Chart):
    """Step of a mechanism in coordinates (x, v, s, w) with x' = J(x) (v + M^-1 G_p^T mu)."""

    system: GGLSystem

    def __init__(self, system: GGLSystem, t: float, y: Array, rows: Array, position_rows: Array) -> None:
        super().__init__(system, t, y, rows)
        self.position_rows = position_rows

    @property
    def unknowns(self) -> tuple[int, ...]:
        return (*super().unknowns, *self.position_rows.tolist())

    def first(self, carry: Array) -> tuple[Array, Array]:
        """Return the first stage (x', v', s', w') from `carry`, x' = v + M^-1 G_p^T mu, and no multipliers."""
        nv = self.system.nv
        return np.concatenate([self.v + carry[:nv], carry[nv:]]), np.empty(0)

    def solve_stage(
        self, t_hat: float, x: Array, v: Array, xhat: Array, factor: float, U: Array, G: Array
    ) -> tuple[Array, Array]:
        """Return x' (nv,), and G (r, nv) where the stage satisfies 0 = g(t_hat, q_n (+) (xhat + factor x')).

        Newton's method solves for mu.

        Raises:
            StepError: if it does not converge, or a row that is not in use is violated.
        """
        s, m = self.system, self.system.manifold
        self.mu, self._x = np.zeros(len(self.position_rows)), x
        if not len(self.position_rows):
            return super().solve_stage(t_hat, x, v, xhat, factor, U, G)
        self._MinvGT_p = MinvGT = lapack().dpotrs(U, G[self.position_rows].T)[0]
        B, dx = m.tangent(x, MinvGT), m.tangent(x, v)
        mech = s.mechanism
        last, scale = np.inf, 1 + np.abs(self.q / mech.q_scales).max()
        for _ in range(ITERATIONS):
            xhat_i = xhat + factor * dx
            g, Ghat = s.closures(m.integrate(self.q, xhat_i), t_hat)
            rates = Ghat[self.position_rows] @ m.velocity(xhat_i, B)
            _, _, dmu, info = lapack().dgesv(factor * rates, -g[self.position_rows])
            size = abs(factor) * np.abs(B @ dmu / mech.coordinate_scales).max()
            if info or not np.isfinite(size):
                break
            if size <= ROUNDING * scale or (size > 0.5 * last and size <= SEARCH_TOLERANCE * scale):
                self._require_satisfied(t_hat, g, m.integrate(self.q, xhat_i))
                s.velocity_correction = MinvGT @ self.mu
                return dx, Ghat[self.rows]
            self.mu, dx, last = self.mu + dmu, dx + B @ dmu, size
        raise StepError("newton", f"Newton's method for the positions of the closures diverges at t = {t_hat:.17g}")

    def _require_satisfied(self, t: float, g: Array, q: Array) -> None:
        mech = self.system.mechanism
        if np.abs(g / mech.row_scales).max(initial=0.0) > SAME_STATE:
            violation = largest_error(mech, g)
            names = contradicting_positions(self.system, t, q)
            why = f"{names} contradict each other" if names else "the rows in use no longer enforce it"
            remark = shortening_remark(mech, violation.name)
            raise StepError("rank", f"{violation.message()} at t = {t:.17g}: {why}{remark}")

    def start(self) -> tuple[Array, Array]:
        """Return (v, v', s', w') and (lam, mu = 0) of the rows in use and the independent position rows, (r + k,)."""
        F, lam = super().start()
        return F, np.concatenate([lam, np.zeros(len(self.position_rows))])

    def residual(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return J(x) (v + M^-1 G_p^T mu) - x' and the other residuals, and (-G v - g_t, -g), (r + k,)."""
        s, nv, r = self.system, self.system.nv, len(self.rows)
        rest, c = super().residual(t, x, dx, z[:r])
        U = s.inertia(t, s.manifold.integrate(self.q, x[:nv]))
        g, G = s.closures(None, t)
        rest[:nv] += s.manifold.tangent(x[:nv], lapack().dpotrs(U, z[r:] @ G[self.position_rows])[0])
        return rest, np.concatenate([c, -g[self.position_rows]])

    def linearize(self, x: Array, dx: Array, z: Array) -> "Linearized":
        """Return the partial derivatives at (x, x', z)."""
        out = LinearizedGGL(*super().linearize(x, dx, z[: len(self.rows)]))
        out.G_p = self.system.jacobian()[self.position_rows]
        return out

    def end(self, t: float, x: Array, dx: Array | None, z: Array) -> tuple[Array, Array]:
        """Return y and (lam, mu) of all rows, (2 ng,)."""
        s, r = self.system, len(self.rows)
        y, lam = super().end(t, x, dx, z[:r])
        g, G = s.closures(None, t)
        if dx is not None:
            self._require_satisfied(t, g, s.split(y)[0])
        return y, np.concatenate([lam, s.all_position_multipliers(s._last[0], G, self.position_rows, z[r:])])

    def all_multipliers(self, z: Array) -> Array:
        """Return the multipliers (lam, mu) of all rows at the last stage's configuration, (2 ng,)."""
        s = self.system
        mu = s.all_position_multipliers(*s._last, self.position_rows, self.mu)
        return np.concatenate([super().all_multipliers(z), mu])

    def project(self, e: Array) -> Array:
        """Project x and v onto G x = 0, G v = 0 in the mass metric, at the configuration of the last stage."""
        s, m, nv = self.system, self.system.manifold, self.system.nv
        e = super().project(e)
        if len(self.position_rows):
            G, MinvGT = s._last[1][self.position_rows], self._MinvGT_p
            normal = MinvGT @ np.linalg.solve(G @ MinvGT, G @ m.velocity(self._x, e[:nv]))
            e[:nv] -= m.tangent(self._x, normal)
        return e


class LinearizedGGL(Linearized):
    """Partial derivatives of the GGL form at mu = 0, with x' = J(x) (v + N mu), N = M^-1 P^T, and additionally 0 = g.

    P = G_p are the independent position rows of G, (k, nv).

    With the letters of `mbdae.mechanism.formulations.steps.implicit_stage`, and m = h times an eigenvalue of the
    method's matrix,

        [ E - m D - m^2 K S J   -L   -m K S J N ] [du' ]
        [ G + m B S J            0     B S J N  ] [dlam]
        [ m P S J                0     P S J N  ] [dmu ]
    """

    G_p: Array

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return E, (E f)_x, (E f)_z and g_x for z = (lam, mu), see `mbdae.system.Linearization`."""
        E, A, L, C = super().matrices()
        P, (J, _) = self.G_p, self.tangent_map
        nv = len(J)
        N = J @ np.linalg.solve(self.partials.E[:nv, :nv], P.T)
        by_mu = np.vstack([N, np.zeros((len(E) - nv, len(P)))])
        return E, A, np.hstack([L, by_mu]), np.vstack([C, padded(P @ np.linalg.inv(J), len(E))])

    def factorize(self, mu: complex) -> Solver:
        """Factorize the matrix, (n + r + k, n + r + k), n = nv + ns + 1, real or complex."""
        S, KS, BS, upper = self.stage_blocks(mu)
        G, P, (J, _) = self.partials.G, self.G_p, self.tangent_map
        n, nv, r = len(upper), len(J), len(G)
        PS, JN = P @ S, J @ np.linalg.solve(self.partials.E[:nv, :nv], P.T)
        blocks = [
            [upper, -self.partials.L, -KS @ JN],
            [padded(G + mu * (BS @ J), n), np.zeros((r, r)), BS @ JN],
            [padded(mu * (PS @ J), n), np.zeros((len(P), r)), PS @ JN],
        ]
        back = self.solver(np.block(blocks))

        def solve(rhs: Array, c: Array) -> tuple[Array, Array]:
            self.counts.solves += 1
            x = rhs[:nv]
            u = back(np.concatenate([rhs[nv:] + KS @ x, c[:r] / mu - BS @ x, c[r:] / mu - PS @ x]))
            z = u[n:]
            return np.concatenate([J @ (S @ (x + mu * (J @ u[:nv]) + JN @ z[r:])), u[:n]]), z

        return solve
