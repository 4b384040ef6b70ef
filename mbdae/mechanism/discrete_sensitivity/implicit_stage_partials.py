"""Partial derivatives of the stage equations of a collocation method, where all stages are solved together.

In coordinates x of a step, q = q_n (+) x, u = (v, s, w), with A, R, J, T of
`mbdae.mechanism.manifold.IntegratePartials` and the partial derivatives K, D, L, B, E of
`mbdae.mechanism.formulations.equation_partials`, dq = A dq_n + R dx and du = du_n + dx_u,

    dx'_q - J dv - T dx_q = 0
    E dx'_u - K dq - D du - L dlam = P dp + f_t dt
    G dv + B dq = -Q dp - (G v + g_t)_t dt

and in the GGL form, v + slip in place of v in the first line, slip = N mu, N = M^-1 P^T with the position rows P,

    dslip = N dmu + M^-1 (d(P^T mu)/dq - dM/dq slip) dq + (...)_p dp,   P dq = -g_p dp - g_t dt
"""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array, StagePartials
from ..formulations.equation_partials import time_partials

if TYPE_CHECKING:
    from ..formulations.ggl import GGLChart
    from ..formulations.implicit_stage import ImplicitStages
    from .parameter_partials import Parameters


def implicit_stage(
    chart: "ImplicitStages",
    t: float,
    x: Array,
    F: Array,
    lam: Array,
    parameters: "Parameters",
    slip: Array | None = None,
) -> StagePartials:
    """Return the partial derivatives of the equations of a stage at t, of x and x', (ny,) each, and lam, (r,).

    ``slip`` (nv,) is the term that the GGL form adds to v, constant here.
    """
    s, rows = chart.system, chart.rows
    nv, ny, r, k = s.nv, s.ny, len(rows), len(parameters)
    q, u = s.manifold.integrate(chart.q, x[:nv]), chart.y[s.nq :] + x[nv:]
    v, inner, vdot, whole = u[:nv], u[nv:-1], F[nv : 2 * nv], np.zeros(s.ng)
    whole[rows] = lam
    at = s.partials(t, q, u, vdot, lam, rows)
    turn = s.manifold.turned(x[:nv], v if slip is None else v + slip)
    f_t, bend, _ = time_partials(s, t, q, v, inner, whole)
    out = StagePartials(*(np.zeros((ny + r, n)) for n in (ny, ny, r, ny, k, 1)))
    out.F[:nv, :nv], out.F[nv:ny, nv:] = np.eye(nv), at.E
    out.x[:nv, :nv], out.x[:nv, nv : 2 * nv] = -turn.T, -turn.J
    out.x[nv:ny, :nv], out.x[nv:ny, nv:] = -at.K @ turn.R, -at.D
    out.x[ny:, :nv], out.x[ny:, nv : 2 * nv] = at.B @ turn.R, at.G
    out.z[nv:ny] = -at.L
    out.y[:, nv:] = out.x[:, nv:]
    out.y[nv:ny, :nv], out.y[ny:, :nv] = -at.K @ turn.A, at.B @ turn.A
    out.p[nv:ny], out.p[ny:] = -parameters.of_forces(t, q, v, inner, vdot, whole), parameters.of_rows(t, q, v)[0][rows]
    out.t[nv:ny, 0], out.t[ny:, 0] = -f_t, bend[rows]
    return out


def stabilised_stage(
    chart: "GGLChart", t: float, x: Array, F: Array, z: Array, parameters: "Parameters"
) -> StagePartials:
    """Return the partial derivatives of a stage of the GGL form, z = (lam, mu), (r + k,)."""
    s, kept, r, nv, ny = chart.system, chart.kept, len(chart.rows), chart.system.nv, chart.system.ny
    q, still, inner, mu = s.manifold.integrate(chart.q, x[:nv]), np.zeros(s.nv), np.zeros(s.ns), np.zeros(s.ng)
    mu[kept] = z[r:]
    M, before, _ = (a.copy() for a in s.inertial.partials(q, still, still))
    G = s.jacobian(q)[kept]
    N = np.linalg.solve(M, G.T)
    slip = N @ z[r:]
    turned = s.constraints.partials(still, mu)[0] - (s.inertial.partials(q, still, slip)[1] - before)
    by_q = np.linalg.solve(M, turned)
    p = parameters
    by_p = p.of_forces(t, q, still, inner, slip, mu) - p.of_forces(t, q, still, inner, still, 0 * mu)
    g_p = p.of_rows(t, q, still)[1][kept]
    g_t = s.g_t(t)[kept]
    held = implicit_stage(chart, t, x, F, z[:r], parameters, slip)
    more = len(kept)
    out = StagePartials(*(np.vstack([a, np.zeros((more, a.shape[1]))]) for a in held))
    out = out._replace(z=np.hstack([out.z, np.zeros((ny + r + more, more))]))
    turn = s.manifold.turned(x[:nv], still)
    out.x[:nv, :nv] -= turn.J @ by_q @ turn.R
    out.y[:nv, :nv] -= turn.J @ by_q @ turn.A
    out.z[:nv, r:] -= turn.J @ N
    out.p[:nv] -= turn.J @ np.linalg.solve(M, by_p[:nv])
    out.x[ny + r :, :nv], out.y[ny + r :, :nv] = G @ turn.R, G @ turn.A
    out.p[ny + r :], out.t[ny + r :, 0] = g_p, g_t
    return out
