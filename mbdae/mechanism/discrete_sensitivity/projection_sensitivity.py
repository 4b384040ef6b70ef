"""Partial derivatives of projections: states onto the closures, and velocities onto rows newly in use.

A correction is the x of least x^T M x with G x = r, so that with multipliers eta

    M dx - G^T deta = d(G^T eta) dq + (G^T eta - M x)_p dp - dM x dq_0,   G dx = dr - d(G x) dq - (G x)_p dp

where M is evaluated at q_0, the end of the step, and G at q, on the way from it to the closures.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ...tolerances import EVALUATION_ROUNDING
from ..formulations.projection import project_positions
from .parameter_partials import Parameters
from .stage_sensitivity import Saddle

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System


class ProjectionSensitivity:
    """Partial derivatives of `mbdae.system.System.restore` and `update_independent_rows` of a mechanism.

    Args:
        system: a workspace that freezes the rows in use.
        parameters: the varied parameters, k of them.
    """

    def __init__(self, system: "Index2System", parameters: Parameters) -> None:
        self.system, self.parameters = system, parameters
        self.k, self.ny = len(parameters), system.ny

    def restored(self, t: float, y: Array) -> Array:
        """Return the partials of `mbdae.system.System.restore` at y, (ny, ny + k): each Gauss-Newton step, and v."""
        s, nv, dp = self.system, self.system.nv, self._unit()
        out = np.eye(self.ny, self.ny + self.k)
        if not s.ng:
            return out
        q, v = s.split(y)
        U = s.inertia(t, q)
        path, *_ = project_positions(s, t, q, U)
        start, dq = q, out[:nv].copy()
        for q in path[:-1] or path:  # even without a correction, its derivative may be nonzero
            (g, G), Q = s.closures(q, t), self.parameters.of_rows(t, q, np.zeros(nv))[1]
            x, dx = self._correction(t, start, q, g, G, G @ dq + Q @ dp, out[:nv], dq, s.constraints.positional)
            turn = s.manifold.turned(-x, x)
            dq = turn.A @ dq - turn.R @ dx
        q, G = path[-1], s.jacobian(path[-1])
        dv = out[nv : 2 * nv].copy()
        B, Q = s.constraints.partials(v, np.zeros(s.ng))[1], self.parameters.of_rows(t, q, v)[0]
        dv -= self._correction(t, start, q, G @ v + s.g_t(t), G, G @ dv + B @ dq + Q @ dp, out[:nv], dq)[1]
        out[:nv], out[nv : 2 * nv] = dq, dv
        return out

    def row_update(self, t: float, y: Array) -> Array:
        """Return the partials of v projected onto rows newly in use, (ny, ny + k)."""
        return self.onto_rows(t, y)[1]

    def onto_rows(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return the change of v by the rows in use, (nv,), and the partials of y after it, (ny, ny + k)."""
        s, nv, dp = self.system, self.system.nv, self._unit()
        out = np.eye(self.ny, self.ny + self.k)
        q, v = s.split(y)
        G = s.jacobian(q)
        B, Q = s.constraints.partials(v, np.zeros(s.ng))[1], self.parameters.of_rows(t, q, v)[0]
        derivative = G @ out[nv : 2 * nv] + B @ out[:nv] + Q @ dp
        x, dx = self._correction(t, q, q, G @ v + s.g_t(t), G, derivative, out[:nv], out[:nv])
        out[nv : 2 * nv] -= dx
        return x, out

    def _correction(
        self,
        t: float,
        q0: Array,
        q: Array,
        r: Array,
        G: Array,
        dr: Array,
        dq0: Array,
        dq: Array,
        kept: Array | None = None,
    ) -> tuple[Array, Array]:
        """Return the correction x (nv,) of r (ng,), and its partials, from those of r, q0 and q, (..., ny + k)."""
        s, nv, rows, p = self.system, self.system.nv, np.array(self.system.in_use, int), self.parameters
        still, inner = np.zeros(nv), np.zeros(s.ns)
        if kept is not None:  # velocity rows have no g
            rows = rows[kept[rows]]
        M, before, _ = (a.copy() for a in s.inertial.partials(q0, still, still))
        saddle = Saddle(M, G[rows], G[rows])
        x, eta = (a[:, 0] for a in saddle.solve(np.zeros((nv, 1)), r[rows, None]))
        above, below = np.zeros_like(dq), dr[rows]
        if np.abs(x).max() > EVALUATION_ROUNDING:
            whole = np.zeros(s.ng)
            whole[rows] = eta
            turned = s.inertial.partials(q0, still, x)[1] - before
            s.jacobian(q)
            K, B = s.constraints.partials(x, whole)
            above, below = K @ dq - turned @ dq0, below - B[rows] @ dq
            if self.k:
                P = p.of_forces(t, q, still, inner, x, whole) - p.of_forces(t, q, still, inner, still, 0 * whole)
                Q = p.of_rows(t, q, x)[0] - p.of_rows(t, q, still)[0]
                above, below = above + P[:nv] @ self._unit(), below - (Q @ self._unit())[rows]
        return x, saddle.solve(above, below)[0]

    def _unit(self) -> Array:
        """Return the partials of the parameters by (dy, dp), (k, ny + k)."""
        return np.eye(self.k, self.ny + self.k, self.ny)
