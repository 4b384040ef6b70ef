"""Partial derivatives of a stage of a half-explicit step of a mechanism.

In coordinates x of a step, q = q_n (+) x, with A, R, J, T of `mbdae.mechanism.manifold.IntegratePartials` and the
partials K, D, B of `mbdae.mechanism.formulations.equation_partials`,

    dq = A dq_n + R dx,   dx' = J dv + T dx,   dqhat = Ahat dq_n + Rhat (dxhat + factor dx')
    [M  -G^T] [dv' ]   [K dq + D du + P dp                                            ]
    [Ghat  0] [dlam] = [-(Bhat dqhat + Ghat (dv_n + dvhat) + Q dp) / factor           ]

with the matrix of the stage itself; cotangents use its transpose. Where friction depends on lam, its partials by lam
are added to G^T.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from ...errors import StepError
from ...system import Array
from ..formulations.equation_partials import time_partials
from .friction_partials import add_friction_partials
from .parameter_partials import Parameters

if TYPE_CHECKING:
    from ..formulations.index2_step import Index2Chart


class Saddle:
    """[M -G^T; Ghat 0], factorized: solved for the tangents of a stage, and transposed for cotangents.

    Raises:
        StepError: if it is singular.
    """

    def __init__(self, M: Array, G: Array, Ghat: Array) -> None:
        self.nv, r = len(M), len(G)
        matrix = np.zeros((self.nv + r, self.nv + r))
        matrix[: self.nv, : self.nv], matrix[: self.nv, self.nv :], matrix[self.nv :, : self.nv] = M, -G.T, Ghat
        self.lu, self.pivots, info = dgetrf(matrix)
        if info:
            raise StepError("singular", "the equations of a stage are singular where its partials are taken")

    def solve(self, above: Array, below: Array, transposed: int = 0) -> tuple[Array, Array]:
        """Return both blocks of the solution for right-hand sides (nv, m) and (r, m)."""
        x = dgetrs(self.lu, self.pivots, np.concatenate([above, below]), trans=transposed)[0]
        return x[: self.nv], x[self.nv :]


class SaddleStageSensitivity:
    """The partials of a stage, see `mbdae.system.StageSensitivity`.

    Args:
        chart: of its step.
        times: t of its equations of motion, and that of its constraints.
        x, xhat: increments of y there, (ny,); the second without its own part.
        factor: of x' in the increment at that.
        F: x', (ny,).
        lam: its multipliers, (r,).
        parameters: the numbers that vary.
    """

    def __init__(
        self,
        chart: "Index2Chart",
        times: tuple[float, float],
        x: Array,
        xhat: Array,
        factor: float,
        F: Array,
        lam: Array,
        parameters: Parameters,
    ) -> None:
        self.s, self.factor, self.F, self.parameters = (s := chart.system), factor, F, parameters
        nv, m, rows, (t, that) = s.nv, s.manifold, chart.rows, times
        q, u, self.vdot = m.integrate(chart.q, x[:nv]), chart.y[s.nq :] + x[nv:], F[nv : 2 * nv]
        xh, vhat = xhat[:nv] + factor * F[:nv], chart.v + xhat[nv : 2 * nv] + factor * self.vdot
        qhat, v, inner = m.integrate(chart.q, xh), u[:nv], u[nv:-1]
        whole = np.zeros(s.ng)
        whole[rows] = lam
        self.at = s.partials(t, q, u, self.vdot, lam, rows)
        self.Ghat, self.Bhat = s.rate_partials(that, qhat, vhat, rows)
        self.P = parameters.of_forces(t, q, v, inner, self.vdot, whole)
        self.Q = parameters.of_rows(that, qhat, vhat)[0][rows]
        if s.sliding:
            self.P += parameters.of_friction(q, v, lam, rows)
            self.at = add_friction_partials(s, self.at, q, v, lam, rows)
        self.turn, self.hat = m.turned(x[:nv], self.speed(v)), m.turned(xh, vhat)
        self.saddle = Saddle(self.at.E[:nv, :nv], self.at.L[:nv].T, self.Ghat)
        self.points = (t, q, v, inner, whole), (that, qhat, vhat, inner, whole), rows

    def forward(self, dx: Array, dxhat: Array, dy: Array, dp: Array, clock: Array | None = None) -> Array:
        """Return dx', (ny, m); ``clock`` are the variations of t, that and the factor, (3, m)."""
        nv, at, turn, hat = self.s.nv, self.at, self.turn, self.hat
        dq, du = turn.A @ dy[:nv] + turn.R @ dx[:nv], dy[nv:] + dx[nv:]
        rate = self.rate(dx, dxhat, dy, dp, dq, du, clock)
        dxh, dvhat = dxhat[:nv] + self.factor * rate, dy[nv : 2 * nv] + dxhat[nv : 2 * nv]
        above = at.K @ dq + at.D @ du + self.P @ dp
        below = self.Q @ dp
        if clock is not None:
            dt, dthat, dfactor = clock
            above += np.outer(time_partials(self.s, *self.points[0])[0], dt)
            below += np.outer(time_partials(self.s, *self.points[1])[1][self.points[2]], dthat)
            dxh = dxh + np.outer(self.F[:nv], dfactor)
            dvhat = dvhat + np.outer(self.vdot, dfactor)
        below += self.Bhat @ (hat.A @ dy[:nv] + hat.R @ dxh) + self.Ghat @ dvhat
        dvdot, dlam = self.saddle.solve(above[:nv], below / -self.factor)
        return np.concatenate([rate, dvdot, above[nv:] + at.L[nv:] @ dlam])

    def reverse(self, F: Array) -> tuple[Array, Array, Array, Array]:
        """Return the cotangents of x, xhat, y_n (ny, m) and p (k, m), of those of x', (ny, m)."""
        nv, at, turn, hat = self.s.nv, self.at, self.turn, self.hat
        mu, nu = self.saddle.solve(F[nv : 2 * nv], at.L[nv:].T @ F[2 * nv :], transposed=1)
        above, nu = np.concatenate([mu, F[2 * nv :]]), nu / -self.factor
        p = self.P.T @ above + self.Q.T @ nu
        q, u, qhat, vhat = at.K.T @ above, at.D.T @ above, self.Bhat.T @ nu, self.Ghat.T @ nu
        xhat, x = np.zeros_like(F), np.zeros_like(F)
        xhat[:nv], xhat[nv : 2 * nv] = hat.R.T @ qhat, vhat
        own = self.rate_reverse(F[:nv] + self.factor * xhat[:nv], x, xhat, q, u, p)
        x[:nv] += turn.R.T @ q
        x[nv:] = u
        y = np.concatenate([turn.A.T @ q + hat.A.T @ qhat + own, u])
        y[nv : 2 * nv] += vhat
        return x, xhat, y, p

    def speed(self, v: Array) -> Array:
        """Return the argument of x' = J(x) ., (nv,)."""
        return v

    def rate(self, dx: Array, dxhat: Array, dy: Array, dp: Array, dq: Array, du: Array, clock: Array | None) -> Array:
        """Return dx', (nv, m)."""
        nv = self.s.nv
        return self.turn.J @ du[:nv] + self.turn.T @ dx[:nv]

    def rate_reverse(self, rate: Array, x: Array, xhat: Array, q: Array, u: Array, p: Array) -> Array | float:
        """Add the cotangents of x, xhat, q, u and p of that of x', (nv, m); return that of q_n alone."""
        nv = self.s.nv
        u[:nv] += self.turn.J.T @ rate
        x[:nv] += self.turn.T.T @ rate
        return 0.0
