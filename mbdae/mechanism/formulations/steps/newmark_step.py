"""Step of a Newmark-type method for the second-order equations of a mechanism, on any configuration manifold.

With u = (v, s, w), and the coefficients of a method (`mbdae.methods.alpha`), the unknowns u_1', lam, mu satisfy

    M v_1' = f + G^T lam,   s_1' = h(...),   w_1' = power   at (t_1, q_1, u_1),    0 = g(t_1, q_1)   [0 = G v_1 + g_t]
    u_1 = u_p + b_1 u_1',   q_1 = q_0 (+) (x_p + b_2 v_1' [+ M_0^-1 G_0^T mu])

in index 3, or with the terms in brackets in the stabilized index-2 form. Newton's method uses exact partials.

Source: Arnold, Bruels, BIT 47 (2007); Bruels, Cardona, Arnold, Mech. Mach. Theory 48 (2012).
"""

from typing import TYPE_CHECKING

import numpy as np

from ....linear_solve import factorized, lapack
from ....system import Array
from .implicit_stage import padded
from .index2_step import Index2Chart

if TYPE_CHECKING:
    from ..index2 import Index2System


class NewmarkStep:
    """Step from (t, y) to t + h with fixed rows; the multipliers are (lam, mu), or lam in index 3."""

    def __init__(self, system: "Index2System", t: float, h: float, y: Array, stabilized: bool) -> None:
        self.system, self.t, self.h, self.y, self.stabilized = system, t, h, y, stabilized
        self.rows = system.rows_of_step(t, y)
        self.chart = Index2Chart(system, t, y, self.rows)
        U, G = system.point(t, self.chart.q)
        has_mu = stabilized and len(self.rows)
        self.normal = lapack().dpotrs(U, G[self.rows].T)[0] if has_mu else np.zeros((system.nv, 0))

    @property
    def size(self) -> int:
        """Length n of u."""
        return self.system.ny - self.system.nv

    def predict(self, x: Array, u: Array, factors: tuple[float, float], guess: Array) -> None:
        """Set x_p - h v_0 (n,), of which nv components are used, u_p - u_0 (n,), (b_1, b_2), a guess of u_1' (n,)."""
        nv = self.system.nv
        self.x, self.u, self.factors, self.guess = self.h * self.chart.v + x[:nv], u, factors, guess

    def first_guess(self) -> tuple[Array, Array]:
        """Return the guess of u_1', and zero multipliers, in which the equations are nearly linear."""
        return self.guess, np.zeros(len(self.rows) + self.normal.shape[1])

    def displacement(self, du: Array, z: Array) -> Array:
        """Return the displacement of y, (ny,)."""
        nv, (b1, b2) = self.system.nv, self.factors
        return np.concatenate([self.x + b2 * du[:nv] + self.normal @ z[len(self.rows) :], self.u + b1 * du])

    def correction(self, du: Array, z: Array) -> tuple[Array, Array]:
        """Return the changes of u_1' and of the multipliers.

        Raises:
            StepError: if the matrix is singular.
        """
        s, r, nv, n, (b1, b2) = self.system, len(self.rows), self.system.nv, len(du), self.factors
        t, dy, lam = self.t + self.h, self.displacement(du, z), z[:r]
        x = dy[:nv]
        residual, rate = self.chart.residual(t, dy, np.concatenate([du[:nv], du]), lam)
        g = s.constraints.residual(t)[self.rows]
        p = s.partials(t, s.manifold.integrate(self.chart.q, x), self.y[s.nq :] + dy[nv:], du[:nv], lam, self.rows)
        V = s.manifold.velocity(x, np.eye(nv))
        KV, BV, GV = p.K @ V, p.B @ V, p.G @ V
        upper = p.E - b1 * p.D
        upper[:, :nv] -= b2 * KV
        scaled = b2 * self.normal  # mu in units of accelerations
        blocks = [[upper, -p.L, -KV @ scaled], [padded(GV, n), np.zeros((r, r)), GV @ self.normal]]
        right = [residual[nv:], -g / b2]
        if self.stabilized:
            blocks.insert(1, [padded(p.G + b2 / b1 * BV, n), np.zeros((r, r)), b2 / b1 * BV @ self.normal])
            right.insert(1, rate / b1)
        s.counts.factorizations += 1
        s.counts.solves += 1
        solve = factorized(np.block(blocks), f"the linear system of an implicit step at t = {self.t:.17g}")
        found = solve(np.concatenate(right))
        found[n + r :] *= b2
        return found[:n], found[n:]

    def measure(self, change: Array, du: Array) -> tuple[float, float]:
        """Return the sizes of a change of v_1 and of v_1 + q/h, relative to the largest speed."""
        mech, nv = self.system.mechanism, self.system.nv
        scales, speeds = mech.coordinate_scales, np.abs(self.chart.v) + np.abs(self.h * du[:nv])
        speed = float((speeds / scales).max()) + np.finfo(float).tiny
        scale = 1 + (1 + float(np.abs(self.chart.q / mech.q_scales).max())) / (abs(self.h) * speed)
        return float(np.abs(self.h * change[:nv] / scales).max()) / speed, scale

    def end(self, du: Array, z: Array) -> tuple[Array, Array]:
        """Return the displacement of y, (ny,), and lam of all rows, (ng,)."""
        s, displacement = self.system, self.displacement(du, z)
        q = s.manifold.integrate(self.chart.q, displacement[: s.nv])
        U, G = s.inertia(self.t + self.h, q), s.jacobian()
        s._last_q, s._last = q, (U, G)
        s.selection_trigger.probe(U, G, self.rows)
        return displacement, s.all_multipliers(U, G, self.rows, z[: len(self.rows)])


def newmark_step(system: "Index2System", t: float, h: float, y: Array, stabilized: bool) -> NewmarkStep:
    """Return a step of a Newmark-type method from (t, y)."""
    return NewmarkStep(system, t, h, y, stabilized)
