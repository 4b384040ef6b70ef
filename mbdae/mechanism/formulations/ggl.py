"""The stabilised index-2 form of a mechanism: the positions of the closures are kept by a second multiplier.

    q' = v + M^-1 G^T mu,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = g(t, q),   0 = G(q) v + g_t(t)

On the exact solution mu = 0. Source: Gear, Gupta, Leimkuhler, J. Comput. Appl. Math. 12 (1985); Hairer, Wanner II,
(VII.1.51).
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgesv, dpotrs

from ...errors import StepError
from ...system import Array, Solver
from .chart import Index2Chart
from .implicit import Linearized, padded
from .index2 import Index2System

if TYPE_CHECKING:
    from ..mechanism import Mechanism

ITERATIONS = 12
ROUNDING = 1e-15  # of 1 + |q|: a correction this small is not made, G belongs to the point without it
STALLED = 1e-10  # of 1 + |q|: nor is one this small that does not shrink
OPEN = 1e-7  # m or rad: what rows that are not in use may show


class GGLSystem(Index2System):
    """`mbdae.system.System` of a mechanism with both levels kept: z = (lam, mu), (2 ng,).

    Rows: mu takes the rows in use. Where the rank is constant 0 = g on these rows describes the same configurations as
    on all; the others are watched.
    """

    def __init__(self, mechanism: "Mechanism") -> None:
        super().__init__(mechanism)
        self.nz = 2 * self.ng
        self.slip = np.zeros(self.nv)  # M^-1 G^T mu at the last stage

    def chart(self, t: float, y: Array) -> "GGLChart":  # noqa: D102
        return GGLChart(self, t, y, super().chart(t, y).rows)

    def derivative(self, t: float, y: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Return (v, v', w') and (lam, mu = 0), (2 ng,), from the hidden constraint."""
        F, lam = super().derivative(t, y)
        self.slip = np.zeros(self.nv)
        return F, np.concatenate([lam, np.zeros(self.ng)])

    def carry(self, F: Array, z: Array) -> Array:
        """Keep (M^-1 G^T mu, v', w')."""
        return np.concatenate([self.slip, F[self.nv :]])


class GGLChart(Index2Chart):
    """A step of a mechanism in coordinates (x, v, w) with x' = J(x) (v + M^-1 G^T mu)."""

    system: GGLSystem

    def first(self, carry: Array) -> tuple[Array, Array]:  # noqa: D102
        nv = self.system.nv
        return np.concatenate([self.v + carry[:nv], carry[nv:]]), np.empty(0)

    def meet(
        self, that: float, x: Array, v: Array, xhat: Array, factor: float, U: Array, G: Array
    ) -> tuple[Array, Array]:
        """Newton's method for mu in 0 = g(that, q_n (+) (xhat + factor x')): x' (nv,), and G (r, nv) there.

        Raises:
            StepError: if it does not converge, or a row that is not in use stays open.
        """
        s, m = self.system, self.system.manifold
        self.mu, self._x = np.zeros(len(G)), x
        if not len(G):
            return super().meet(that, x, v, xhat, factor, U, G)
        slips = dpotrs(U, G.T)[0]
        B, dx = m.tangent(x, slips), m.tangent(x, v)
        last, scale = np.inf, 1 + np.abs(self.q).max()
        for _ in range(ITERATIONS):
            xhat_i = xhat + factor * dx
            g, Ghat = s.closures(m.integrate(self.q, xhat_i), that)
            Ghat = Ghat[self.rows]
            _, _, dmu, info = dgesv(factor * Ghat @ m.velocity(xhat_i, B), -g[self.rows])
            size = abs(factor) * np.abs(B @ dmu).max()
            if info or not np.isfinite(size):
                break
            if size <= ROUNDING * scale or (size > 0.5 * last and size <= STALLED * scale):
                self._watch(that, g)
                s.slip = slips @ self.mu
                return dx, Ghat
            self.mu, dx, last = self.mu + dmu, dx + B @ dmu, size
        raise StepError("newton", f"Newton's method for the positions of the closures diverges at t = {that:.17g}")

    def _watch(self, t: float, g: Array) -> None:
        gap = float(np.abs(g).max(initial=0.0))
        if gap > OPEN:
            name = self.system.mechanism.row_closure(int(np.abs(g).argmax()))
            raise StepError("rank", f"closure {name!r} opens by {gap:.2g} at t = {t:.17g}: other rows keep it no more")

    def start(self) -> tuple[Array, Array]:
        """Return (v, v', w') and (lam, mu = 0) of the rows in use, (2 r,)."""
        F, lam = super().start()
        return F, np.concatenate([lam, np.zeros(len(lam))])

    def residual(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return J(x) (v + M^-1 G^T mu) - x' above the rest, (2 nv + 1,), and (-G v, -g), (2 r,)."""
        s, nv, r = self.system, self.system.nv, len(self.rows)
        rest, c = super().residual(t, x, dx, z[:r])
        U = s.inertia(t, s.manifold.integrate(self.q, x[:nv]))
        g, G = s.closures(None, t)
        rest[:nv] += s.manifold.tangent(x[:nv], dpotrs(U, z[r:] @ G[self.rows])[0])
        return rest, np.concatenate([c, -g[self.rows]])

    def linearize(self, x: Array, dx: Array, z: Array) -> "Linearized":
        """Take the slopes at (x, x', z)."""
        return LinearizedGGL(*super().linearize(x, dx, z[: len(self.rows)]))

    def end(self, t: float, x: Array, dx: Array, z: Array) -> tuple[Array, Array]:
        """Return y, and (lam, mu) of all rows, (2 ng,)."""
        s, r = self.system, len(self.rows)
        y, lam = super().end(t, x, dx, z[:r])
        g, G = s.closures(None, t)
        self._watch(t, g)
        return y, np.concatenate([lam, s.all_multipliers(s._last[0], G, self.rows, z[r:])])

    def all_multipliers(self, z: Array) -> Array:
        """Multipliers (lam, mu) of all rows at the last stage's configuration, (2 ng,)."""
        s = self.system
        return np.concatenate([super().all_multipliers(z), s.all_multipliers(*s._last, self.rows, self.mu)])

    def project(self, e: Array) -> Array:
        """Project positions and velocities in the mass metric on G x = 0, G v = 0 at the last stage's configuration."""
        s, m, nv = self.system, self.system.manifold, self.system.nv
        e = super().project(e)
        if len(self.rows):
            normal = s._MinvGT @ np.linalg.solve(s._G @ s._MinvGT, s._G @ m.velocity(self._x, e[:nv]))
            e[:nv] -= m.tangent(self._x, normal)
        return e


class LinearizedGGL(Linearized):
    """Slopes of the stabilised form at mu = 0, with x' = J(x) (v + N mu), N = M^-1 G^T, and 0 = g besides.

    With the letters of `mbdae.mechanism.formulations.implicit`, and m = h times an eigenvalue of the method's matrix,

        [ E - m D - m^2 K S J   -L   -m K S J N ] [du' ]
        [ G + m B S J            0     B S J N  ] [dlam]
        [ m G S J                0     G S J N  ] [dmu ]
    """

    def factorize(self, mu: complex) -> Solver:
        """Factorize the matrix, (nv + ns + 1 + 2 r, nv + ns + 1 + 2 r), real or complex."""
        S, KS, BS, upper = self.parts(mu)
        G, (J, _) = self.slopes.G, self.turning
        n, nv, r = len(upper), len(J), len(G)
        GS, JN, nil = G @ S, J @ np.linalg.solve(self.slopes.E[:nv, :nv], G.T), np.zeros((r, r))
        back = self.back(
            [
                [upper, -self.slopes.L, -KS @ JN],
                [padded(G + mu * (BS @ J), n), nil, BS @ JN],
                [padded(mu * (GS @ J), n), nil, GS @ JN],
            ]
        )

        def solve(rhs: Array, c: Array) -> tuple[Array, Array]:
            self.counts.solves += 1
            x = rhs[:nv]
            u = back(np.concatenate([rhs[nv:] + KS @ x, c[:r] / mu - BS @ x, c[r:] / mu - GS @ x]))
            z = u[n:]
            return np.concatenate([J @ (S @ (x + mu * (J @ u[:nv]) + JN @ z[r:])), u[:n]]), z

        return solve
