"""How the steps of a mechanism's run move with the state and with its numbers.

Variations are those of a computed step, not of the motion: dy (ny, m) in the tangent at y, dp (k, m) of k parameters,
m of them at once. At a stage in coordinates x of a step, q = q_n (+) x, with A, R, J, T of `Manifold.turned` and the
slopes K, D, B of `mbdae.mechanism.formulations.derivatives`,

    dq = A dq_n + R dx,   dx' = J dv + T dx,   dqhat = Ahat dq_n + Rhat (dxhat + factor dx')
    [M  -G^T] [dv' ]   [K dq + D du + P dp                                            ]
    [Ghat  0] [dlam] = [-(Bhat dqhat + Ghat (dv_n + dvhat) + Q dp) / factor           ]

in which the matrix is the stage's own. Points that obey the hidden constraint, projections and jumps are linear in
(dy, dp), and stand as matrices.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dgetrf, dgetrs

from ...errors import AssemblyError, InputError, StepError
from ...system import Array
from .derivatives import hidden_slopes, time_slopes
from .parameters import Parameters
from .projection import approach, felt

if TYPE_CHECKING:
    from .chart import Index2Chart
    from .index2 import Index2System

JUMP_WIDTH = 1e-2  # of differences of sampled controllers, which are functions of the user
SIXTH = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
UNMOVED = 1e-13  # rad or m: what a projection moves by so little adds no slopes of its own


class Saddle:
    """[M -G^T; Ghat 0], factorized: solved for a stage's variations, and transposed for cotangents.

    Raises:
        StepError: where it is singular.
    """

    def __init__(self, M: Array, G: Array, Ghat: Array) -> None:
        self.nv, r = len(M), len(G)
        matrix = np.zeros((self.nv + r, self.nv + r))
        matrix[: self.nv, : self.nv], matrix[: self.nv, self.nv :], matrix[self.nv :, : self.nv] = M, -G.T, Ghat
        self.lu, self.pivots, info = dgetrf(matrix)
        if info:
            raise StepError("singular", "the equations of a stage are singular where its slopes are taken")

    def solve(self, above: Array, below: Array, transposed: int = 0) -> tuple[Array, Array]:
        """Return both parts of the solution, of right sides (nv, m) and (r, m)."""
        x = dgetrs(self.lu, self.pivots, np.concatenate([above, below]), trans=transposed)[0]
        return x[: self.nv], x[self.nv :]


class StageSlopes:
    """The slopes of a stage, see `mbdae.system.StageVariation`."""

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
        self.s, self.factor, self.F = (s := chart.system), factor, F
        nv, m, rows, (t, that) = s.nv, s.manifold, chart.rows, times
        q, u, self.vdot = m.integrate(chart.q, x[:nv]), chart.y[s.nq :] + x[nv:], F[nv : 2 * nv]
        xh, vhat = xhat[:nv] + factor * F[:nv], chart.v + xhat[nv : 2 * nv] + factor * self.vdot
        qhat, v, inner = m.integrate(chart.q, xh), u[:nv], u[nv:-1]
        whole = np.zeros(s.ng)
        whole[rows] = lam
        self.at = s.slopes(t, q, u, self.vdot, lam, rows)
        self.Ghat, self.Bhat = s.rate_slopes(that, qhat, vhat, rows)
        self.P = parameters.of_forces(t, q, v, inner, self.vdot, whole)
        self.Q = parameters.of_rows(that, qhat, vhat)[0][rows]
        self.turn, self.hat = m.turned(x[:nv], v), m.turned(xh, vhat)
        self.saddle = Saddle(self.at.E[:nv, :nv], self.at.G, self.Ghat)
        self.points = (t, q, v, inner, whole), (that, qhat, vhat, inner, whole), rows

    def forward(self, dx: Array, dxhat: Array, dy: Array, dp: Array, clock: Array | None = None) -> Array:
        """Return dx', (ny, m); ``clock`` are the variations of t, that and the factor, (3, m)."""
        nv, at, turn, hat = self.s.nv, self.at, self.turn, self.hat
        dq, du = turn.A @ dy[:nv] + turn.R @ dx[:nv], dy[nv:] + dx[nv:]
        rate = turn.J @ du[:nv] + turn.T @ dx[:nv]
        dxh, dvhat = dxhat[:nv] + self.factor * rate, dy[nv : 2 * nv] + dxhat[nv : 2 * nv]
        above = at.K @ dq + at.D @ du + self.P @ dp
        below = self.Q @ dp
        if clock is not None:
            dt, dthat, dfactor = clock
            above += np.outer(time_slopes(self.s, *self.points[0])[0], dt)
            below += np.outer(time_slopes(self.s, *self.points[1])[1][self.points[2]], dthat)
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
        rate = F[:nv] + self.factor * xhat[:nv]
        u[:nv] += turn.J.T @ rate
        x[:nv], x[nv:] = turn.R.T @ q + turn.T.T @ rate, u
        y = np.concatenate([turn.A.T @ q + hat.A.T @ qhat, u])
        y[nv : 2 * nv] += vhat
        return x, xhat, y, p


class RateSlopes(NamedTuple):
    """Slopes of y' and of lam of all rows at a point of the hidden constraint.

    Attributes:
        rate: by (dy, dp, dt), (ny, ny + k + 1).
        lam: alike, (ng, ny + k + 1).
    """

    rate: Array
    lam: Array


class Variations:
    """The slopes of what a run of a mechanism is made of, see `mbdae.system.Variations`.

    Args:
        system: a workspace that holds the rows in use.
        parameters: the numbers that vary.
    """

    def __init__(self, system: "Index2System", parameters: Parameters) -> None:
        self.system, self.parameters, self.k, self.ny = system, parameters, len(parameters), system.ny

    def stage(
        self,
        chart: "Index2Chart",
        times: tuple[float, float],
        x: Array,
        xhat: Array,
        factor: float,
        F: Array,
        lam: Array,
    ) -> StageSlopes:
        """Take the slopes of a stage at t and that, of x', (ny,), and lam, (r,)."""
        return StageSlopes(chart, times, x, xhat, factor, F, lam, self.parameters)

    def first(self, dy: Array, carry: Array) -> Array:
        """Return dx' of an explicit first stage, (ny, m)."""
        return np.concatenate([dy[self.system.nv : 2 * self.system.nv], carry])

    def first_reverse(self, F: Array) -> tuple[Array, Array]:
        """Return the cotangents of y and of the carry."""
        y, nv = np.zeros_like(F), self.system.nv
        y[nv : 2 * nv] = F[:nv]
        return y, F[nv:]

    def carried(self, F: Array) -> Array:
        """Return the variation of the carry."""
        return F[self.system.nv :]

    def carried_reverse(self, carry: Array) -> Array:
        """Return the cotangent of x'."""
        return np.concatenate([np.zeros((self.system.nv, carry.shape[1])), carry])

    def end(self, x: Array) -> tuple[Array, Array]:
        """Return Y and X of d(y (+) x) = Y dy + X dx, (ny, ny) each."""
        nv, Y, X = self.system.nv, np.eye(self.ny), np.eye(self.ny)
        turn = self.system.manifold.turned(x[:nv], x[:nv])
        Y[:nv, :nv], X[:nv, :nv] = turn.A, turn.R
        return Y, X

    def rate(self, t: float, y: Array) -> RateSlopes:
        """Take the slopes of y' and of all multipliers on M v' = f + G^T lam, 0 = G v' + gamma."""
        s, nv, n = self.system, self.system.nv, self.system.ny - self.system.nv
        F, found = s.derivative(t, y)
        (q, v), inner, vdot, rows = s.split(y), s.inner(y), F[nv : 2 * nv], np.array(s.in_use, int)
        G = s.jacobian(q)
        force = G.T @ found
        lam = np.linalg.lstsq(G[rows].T, force)[0] if len(rows) else np.empty(0)
        whole = np.zeros(s.ng)
        whole[rows] = lam
        at, p = s.slopes(t, q, y[s.nq :], vdot, lam, rows), self.parameters
        f_t, _, gamma_t = time_slopes(s, t, q, v, inner, whole)
        by_q, by_v = hidden_slopes(s, q, v)
        by_q += s.constraints.slopes(vdot, whole)[1]
        Q = p.of_rows(t, q, vdot)[0] - p.of_rows(t, q, np.zeros(nv))[0] + p.of_bias(t, q, v)
        above = np.hstack([at.K, at.D, p.of_forces(t, q, v, inner, vdot, whole), f_t[:, None]])
        below = np.hstack([by_q, by_v, np.zeros((s.ng, n - nv)), Q, gamma_t[:, None]])
        dvdot, dlam = Saddle(at.E[:nv, :nv], at.G, at.G).solve(above[:nv], -below[rows])
        moves = np.eye(nv, self.ny + self.k + 1, nv)
        rate = np.concatenate([moves, dvdot, above[nv:] + at.L[nv:] @ dlam])
        return RateSlopes(rate, self._all(t, q, v, inner, found, whole, rows, dlam))

    def _all(
        self, t: float, q: Array, v: Array, inner: Array, found: Array, whole: Array, rows: Array, dlam: Array
    ) -> Array:
        """Slopes of the multipliers of all rows, of least norm, from those in use, (ng, ...).

        With A = G^T of fixed rank, y = (A^+)^T lam: dlam = A^+ (dF - dA lam) + (1 - A^+ A) d(G y), F = G^T lam.
        """
        s, out = self.system, np.zeros((self.system.ng, dlam.shape[1]))
        if len(rows) == s.ng:
            out[rows] = dlam
            return out
        G, nv, p, still = s.jacobian(q), s.nv, self.parameters, np.zeros(s.nv)
        left, sizes, right = np.linalg.svd(G, full_matrices=False)
        left, sizes, right = left[:, : len(rows)], sizes[: len(rows)], right[: len(rows)]
        inverse = (left / sizes) @ right  # (G^T)^+
        y = right.T @ ((left.T @ found) / sizes)
        of = slice(self.ny, self.ny + self.k)
        force, turned = G[rows].T @ dlam, np.zeros_like(out)
        force[:, :nv] += s.constraints.slopes(v, whole - found)[0]
        turned[:, :nv] = s.constraints.slopes(y, found)[1]
        if self.k:
            force[:, of] += p.of_forces(t, q, v, inner, still, whole)[:nv]
            force[:, of] -= p.of_forces(t, q, v, inner, still, found)[:nv]
            turned[:, of] = p.of_rows(t, q, y)[0] - p.of_rows(t, q, still)[0]
        return inverse @ force + turned - left @ (left.T @ turned)

    def restored(self, t: float, y: Array) -> Array:
        """Slopes of `mbdae.system.System.restore` at y, (ny, ny + k): each Gauss-Newton step, and v."""
        s, nv, dp = self.system, self.system.nv, self._unit()
        out = np.eye(self.ny, self.ny + self.k)
        if not s.ng:
            return out
        q, v = s.split(y)
        U = s.inertia(t, q)
        path, *_ = approach(s, t, q, U)
        start, dq = q, out[:nv].copy()
        for q in path[:-1]:
            (g, G), Q = s.closures(q, t), self.parameters.of_rows(t, q, np.zeros(nv))[1]
            x, dx = self._correction(t, start, q, g, G, G @ dq + Q @ dp, out[:nv], dq)
            turn = s.manifold.turned(-x, x)
            dq = turn.A @ dq - turn.R @ dx
        q, G = path[-1], s.jacobian(path[-1])
        rate = G @ v + s.g_t(t)
        dv = out[nv : 2 * nv].copy()
        if felt(rate, v):
            B, Q = s.constraints.slopes(v, np.zeros(s.ng))[1], self.parameters.of_rows(t, q, v)[0]
            dv -= self._correction(t, start, q, rate, G, G @ dv + B @ dq + Q @ dp, out[:nv], dq)[1]
        out[:nv], out[nv : 2 * nv] = dq, dv
        return out

    def settled(self, t: float, y: Array) -> Array:
        """Slopes of v brought onto rows newly in use, `mbdae.system.System.settle`, (ny, ny + k)."""
        s, nv, dp = self.system, self.system.nv, self._unit()
        out = np.eye(self.ny, self.ny + self.k)
        q, v = s.split(y)
        G = s.jacobian(q)
        B, Q = s.constraints.slopes(v, np.zeros(s.ng))[1], self.parameters.of_rows(t, q, v)[0]
        slope = G @ out[nv : 2 * nv] + B @ out[:nv] + Q @ dp
        out[nv : 2 * nv] -= self._correction(t, q, q, G @ v + s.g_t(t), G, slope, out[:nv], out[:nv])[1]
        return out

    def _correction(
        self, t: float, q0: Array, q: Array, r: Array, G: Array, dr: Array, dq0: Array, dq: Array
    ) -> tuple[Array, Array]:
        """The x of least x^T M(q0) x with G(q) x = r (ng,), and its slopes, of those of r, q0 and q, (..., m).

        M dx - G^T deta = d(G^T eta) dq - dM x dq0,   G dx = dr - d(G x) dq
        """
        s, nv, rows, p = self.system, self.system.nv, np.array(self.system.in_use, int), self.parameters
        still, inner = np.zeros(nv), np.zeros(s.ns)
        M, before, _ = (a.copy() for a in s.inertial.slopes(q0, still, still))
        saddle = Saddle(M, G[rows], G[rows])
        x, eta = (a[:, 0] for a in saddle.solve(np.zeros((nv, 1)), r[rows, None]))
        above, below = np.zeros_like(dq), dr[rows]
        if np.abs(x).max() > UNMOVED:
            whole = np.zeros(s.ng)
            whole[rows] = eta
            turned = s.inertial.slopes(q0, still, x)[1] - before
            s.jacobian(q)
            K, B = s.constraints.slopes(x, whole)
            above, below = K @ dq - turned @ dq0, below - B[rows] @ dq
            if self.k:
                P = p.of_forces(t, q, still, inner, x, whole) - p.of_forces(t, q, still, inner, still, 0 * whole)
                Q = p.of_rows(t, q, x)[0] - p.of_rows(t, q, still)[0]
                above, below = above + P[:nv] @ self._unit(), below - (Q @ self._unit())[rows]
        return x, saddle.solve(above, below)[0]

    def _unit(self) -> Array:
        """The parameters among (dy, dp), (k, ny + k)."""
        return np.eye(self.k, self.ny + self.k, self.ny)

    def jumped(self, t: float, y: Array) -> Array:
        """Slopes of `mbdae.system.System.jump` at y, (ny, ny + k): differences of the controllers alone."""
        s, out = self.system, np.eye(self.ny, self.ny + self.k)
        for i in range(self.ny - 1) if s.ns else ():
            e = np.zeros(self.ny)
            e[i] = JUMP_WIDTH
            at = {k: s.inner(s.jump(t, s.add(y, k * e))) for k in (-3, -2, -1, 1, 2, 3)}
            out[2 * s.nv : -1, i] = sum(w / JUMP_WIDTH * (at[k] - at[-k]) for k, w in SIXTH.items())
        for i, (p, laws) in enumerate(zip(self.parameters.all, self.parameters.laws, strict=True)):
            if laws.near and len(laws.at):
                (q, v), inner = s.split(y), s.inner(y)[laws.at]
                found = {k: f.jump(t, q, v, inner) for k, f in laws.near.items()}
                out[2 * s.nv + laws.at, self.ny + i] = p.quotient(found)
        return out

    def start(self, t: float, given: Array) -> Array:
        """Slopes of the mechanism's own start with respect to the parameters, (ny, k).

        Differences of assembly, of order six; what closures determine is then made exact.
        """
        s, out, nv = self.system, np.zeros((self.ny, self.k)), self.system.nv
        mech = self.parameters.mech
        base, (q, v) = mech.point(t=t), s.split(given)
        for i, p in enumerate(self.parameters.all):
            try:
                out[:, i] = p.quotient({k: s.difference(base, m.point(t=t)) for k, m in p.near.items()})
            except AssemblyError as e:
                raise InputError(f"the start cannot be assembled beside this value of {p.name!r}: {e}") from None
        if not s.ng or not mech.start_values.assemble:
            return out
        driven = {d.joint for d in mech.drivers}
        tables = [
            {n: x for n, x in table.items() if n not in driven} for table in (mech.start_values.q, mech.start_values.v)
        ]
        held = [mech.coordinates(table, of_v=bool(i))[1] for i, table in enumerate(tables)]
        free_q, free_v = (np.setdiff1d(np.arange(nv), h) for h in held)
        G = s.jacobian(q)
        g = self.parameters.of_rows(t, q, np.zeros(nv))[1]
        out[free_q] -= np.linalg.pinv(G[:, free_q], rcond=1e-8) @ (G @ out[:nv] + g)
        pin.computeJointJacobians(s.model, s.data, q)
        B, Q = s.constraints.slopes(v, np.zeros(s.ng))[1], self.parameters.of_rows(t, q, v)[0]
        left = G @ out[nv : 2 * nv] + B @ out[:nv] + Q
        out[nv + free_v] -= np.linalg.pinv(G[:, free_v], rcond=1e-8) @ left
        return out
