"""Discrete sensitivity of half-explicit runs of the GGL form, whose stages also satisfy position constraints.

With slip = M^-1 P^T mu of the position rows P, x' = J(x) (v + slip), and 0 = g at qhat, a stage is two successive
systems: first

    [M          -P^T] [dslip]   [(d(P^T mu)/dq - dM slip) dq + (P^T mu - M slip)_p dp                       ]
    [Phat Rhat J   0] [dmu  ] = [-(Phat (Ahat dq_n + Rhat (dxhat + factor (J dv + T dx))) + g_p dp) / factor]

and then, with the resulting dx', that of `mbdae.mechanism.discrete_sensitivity.stage_sensitivity`. Stages return dslip
after dx', since a method with an explicit first stage carries that of the last one.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...system import Array, StagePartials
from .implicit_stage_partials import stabilised_stage
from .index2_sensitivity import Index2Sensitivity
from .stage_sensitivity import Saddle, SaddleStageSensitivity

if TYPE_CHECKING:
    from ..formulations.ggl import GGLChart, GGLSystem


class GGLStageSensitivity(SaddleStageSensitivity):
    """Partial derivatives of a stage, see `mbdae.system.StageSensitivity`; F has dslip after dx', (ny + nv, m)."""

    def __init__(self, chart: "GGLChart", *stage: Any) -> None:
        s = chart.system
        self.slip, kept, still = s.slip.copy(), chart.kept, np.zeros(s.nv)
        super().__init__(chart, *stage)
        (t, q, _, inner, _), (that, qhat, *_), _ = self.points
        mu = np.zeros(s.ng)
        mu[kept] = chart.mu
        M, before, _ = (a.copy() for a in s.inertial.partials(q, still, still))
        P = s.jacobian(q)[kept]
        self.W = s.constraints.partials(still, mu)[0] - (s.inertial.partials(q, still, self.slip)[1] - before)
        p = self.parameters
        forces = p.of_forces(t, q, still, inner, self.slip, mu) - p.of_forces(t, q, still, inner, still, 0 * mu)
        self.by_p, self.g_p, self.g_t = forces[: s.nv], p.of_rows(that, qhat, still)[1][kept], s.g_t(that)[kept]
        self.Phat = s.jacobian(qhat)[kept]
        self.positions = Saddle(M, P, self.Phat @ self.hat.R @ self.turn.J)

    def speed(self, v: Array) -> Array:
        """Return the argument of x' = J(x) ., (nv,)."""
        return v + self.slip

    def forward(self, dx: Array, dxhat: Array, dy: Array, dp: Array, clock: Array | None = None) -> Array:
        """Return dx' and dslip, (ny + nv, m)."""
        return np.concatenate([super().forward(dx, dxhat, dy, dp, clock), self.dslip])

    def rate(self, dx: Array, dxhat: Array, dy: Array, dp: Array, dq: Array, du: Array, clock: Array | None) -> Array:
        """Return dx', (nv, m); stores dslip."""
        nv, hat = self.s.nv, self.hat
        held = super().rate(dx, dxhat, dy, dp, dq, du, clock)
        moved = hat.A @ dy[:nv] + hat.R @ (dxhat[:nv] + self.factor * held)
        if clock is not None:
            moved = moved + hat.R @ np.outer(self.F[:nv], clock[2])
        below = self.Phat @ moved + self.g_p @ dp
        if clock is not None:
            below += np.outer(self.g_t, clock[1])
        self.dslip = self.positions.solve(self.W @ dq + self.by_p @ dp, below / -self.factor)[0]
        return held + self.turn.J @ self.dslip

    def reverse(self, F: Array) -> tuple[Array, Array, Array, Array]:
        """Return the cotangents of x, xhat, y_n (ny, m) and p (k, m), of those of x' and the slip, (ny + nv, m)."""
        ny = self.s.ny
        self.of_slip = F[ny:]
        return super().reverse(F[:ny])

    def rate_reverse(self, rate: Array, x: Array, xhat: Array, q: Array, u: Array, p: Array) -> Array:
        """Add the cotangents of x, xhat, q, u and p of that of x', (nv, m); return that of q_n alone."""
        nv, hat = self.s.nv, self.hat
        above, below = self.positions.solve(
            self.turn.J.T @ rate + self.of_slip, np.zeros((len(self.Phat), rate.shape[1])), transposed=1
        )
        below = below / -self.factor
        met = self.Phat.T @ below
        q += self.W.T @ above
        p += self.by_p.T @ above + self.g_p.T @ below
        xhat[:nv] += (turned := hat.R.T @ met)
        super().rate_reverse(rate + self.factor * turned, x, xhat, q, u, p)
        return hat.A.T @ met


class GGLSensitivity(Index2Sensitivity):
    """Discrete sensitivity of a run in the GGL form; the carry of half-explicit methods is (slip, v', s', w')."""

    system: "GGLSystem"
    of_stage = GGLStageSensitivity

    def implicit(self, chart: "GGLChart", t: float, x: Array, F: Array, z: Array) -> StagePartials:  # type: ignore[override]
        """Return the partial derivatives of a stage of a collocation method, with z = (lam, mu)."""
        return stabilised_stage(chart, t, x, F, z, self.parameters)

    @property
    def width(self) -> int:
        """Length of a stage, (ny + nv,)."""
        return self.ny + self.system.nv

    def first(self, dy: Array, carry: Array) -> Array:
        """Return dx' of an explicit first stage, and dslip, (ny + nv, m)."""
        nv = self.system.nv
        return np.concatenate([dy[nv : 2 * nv] + carry[:nv], carry[nv:], carry[:nv]])

    def first_reverse(self, F: Array) -> tuple[Array, Array]:
        """Return the cotangents of y and of the carry."""
        nv, ny = self.system.nv, self.ny
        y = np.zeros((ny, F.shape[1]))
        y[nv : 2 * nv] = F[:nv]
        return y, np.concatenate([F[:nv] + F[ny:], F[nv:ny]])

    def carried(self, F: Array) -> Array:
        """Return the variation of the carry."""
        return np.concatenate([F[self.ny :], F[self.system.nv : self.ny]])

    def carried_reverse(self, carry: Array) -> Array:
        """Return the cotangent of x' and the slip."""
        nv = self.system.nv
        return np.concatenate([np.zeros((nv, carry.shape[1])), carry[nv:], carry[:nv]])

    def renewed(self, t: float, y: Array) -> Array:
        """Return the partials of the carry restarted at y, where mu = 0."""
        return np.vstack([np.zeros((self.system.nv, self.ny + self.k)), super().renewed(t, y)])
