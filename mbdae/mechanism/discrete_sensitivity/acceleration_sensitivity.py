"""Partial derivatives of v' and lam at a point, from the hidden constraint."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...system import Array
from ..formulations.equation_partials import gamma_partials, time_partials
from .friction_partials import friction_partials
from .parameter_partials import Parameters

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System


class TimeDerivativePartials(NamedTuple):
    """Partial derivatives of y' and of lam of all rows at a point of the hidden constraint.

    Attributes:
        rate: partials of y' with respect to (y, p, t), (ny, ny + k + 1).
        lam: partials of lam, (ng, ny + k + 1).
    """

    rate: Array
    lam: Array


class AccelerationSensitivity:
    """Partial derivatives of M v' = f + G^T lam, 0 = G v' + gamma, s' = h at points.

    Args:
        system: a workspace.
        parameters: the varied parameters, k of them.
    """

    def __init__(self, system: "Index2System", parameters: Parameters) -> None:
        self.system, self.parameters = system, parameters
        self.k, self.ny = len(parameters), system.ny

    def friction(self, q: Array, v: Array, lam: Array) -> tuple[Array, Array, Array]:
        """Return the partials of friction that depends on multipliers, and of its power, for lam (ng,) by row.

        They are with respect to q, (n, nv), (v, s, w), (n, n), and the parameters, (k, n), where n = nv + ns + 1.
        """
        rows = np.array(self.system.in_use, int)
        K, D = friction_partials(self.system, q, v, lam[rows], rows)
        return K, D, np.ascontiguousarray(self.parameters.friction_partials(q, v, lam[rows], rows).T)

    def rate(self, t: float, y: Array, multipliers: bool = True) -> TimeDerivativePartials:
        """Return the partials of y' in M v' = f + G^T lam, 0 = G v' + gamma, and of all multipliers if requested."""
        s, nv, n = self.system, self.system.nv, self.system.ny - self.system.nv
        F, lam_all = s.derivative(t, y)
        lam_all = lam_all[: s.ng]
        (q, v), states, vdot, rows = s.split(y), s.element_states(y), F[nv : 2 * nv], np.array(s.in_use, int)
        G = s.jacobian(q)
        force = G.T @ lam_all
        lam = np.linalg.lstsq(G[rows].T, force)[0] if len(rows) else np.empty(0)
        lam_in_use = np.zeros(s.ng)
        lam_in_use[rows] = lam
        at, p = s.partials(t, q, y[s.nq :], vdot, lam, rows), self.parameters
        f_t, _, gamma_t = time_partials(s, t, q, v, states, lam_in_use)
        by_q, by_v = gamma_partials(s, q, v)
        by_q += s.constraints.partials(vdot, lam_in_use)[1]
        Q = p.row_partials(t, q, vdot)[0] - p.row_partials(t, q, np.zeros(nv))[0] + p.bias_partials(t, q, v)
        P = p.force_partials(t, q, v, states, vdot, lam_in_use)
        if s.closure_friction:
            K, D, by_p = self.friction(q, v, lam_in_use)
            at, P = at._replace(K=at.K + K, D=at.D + D), P + by_p.T
        force_partials = np.hstack([at.K, at.D, P, f_t[:, None]])
        constraint_partials = np.hstack([by_q, by_v, np.zeros((s.ng, n - nv)), Q, gamma_t[:, None]])
        saddle = np.block([[at.E[:nv, :nv], -at.L[:nv]], [at.G, np.zeros((len(rows), len(rows)))]])
        right_side = np.vstack([force_partials[:nv], -constraint_partials[rows]])
        dvdot, dlam = np.split(np.linalg.solve(saddle, right_side), [nv])
        dv = np.eye(nv, self.ny + self.k + 1, nv)
        rate = np.concatenate([dv, dvdot, force_partials[nv:] + at.L[nv:] @ dlam])
        if not multipliers:
            return TimeDerivativePartials(rate, np.empty((0, rate.shape[1])))
        dlam_all = self._all_multiplier_partials(t, q, v, states, lam_all, lam_in_use, rows, dlam)
        return TimeDerivativePartials(rate, dlam_all)

    def _all_multiplier_partials(
        self, t: float, q: Array, v: Array, states: Array, lam_all: Array, lam_in_use: Array, rows: Array, dlam: Array
    ) -> Array:
        """Return the partials of minimum-norm multipliers of all rows, from those of the rows in use, (ng, ...).

        With A = G^T of fixed rank, y = (A^+)^T lam: dlam = A^+ (dF - dA lam) + (1 - A^+ A) d(G y), F = G^T lam.
        """
        s, out = self.system, np.zeros((self.system.ng, dlam.shape[1]))
        if len(rows) == s.ng:
            out[rows] = dlam
            return out
        G, nv, p, zeros = s.jacobian(q), s.nv, self.parameters, np.zeros(s.nv)
        U, sigma, Vt = np.linalg.svd(G, full_matrices=False)
        U, sigma, Vt = U[:, : len(rows)], sigma[: len(rows)], Vt[: len(rows)]
        inverse = (U / sigma) @ Vt  # (G^T)^+
        y = Vt.T @ ((U.T @ lam_all) / sigma)
        columns = slice(self.ny, self.ny + self.k)
        force, row_terms = G[rows].T @ dlam, np.zeros_like(out)
        force[:, :nv] += s.constraints.partials(v, lam_in_use - lam_all)[0]
        row_terms[:, :nv] = s.constraints.partials(y, lam_all)[1]
        if self.k:
            force[:, columns] += p.force_partials(t, q, v, states, zeros, lam_in_use)[:nv]
            force[:, columns] -= p.force_partials(t, q, v, states, zeros, lam_all)[:nv]
            row_terms[:, columns] = p.row_partials(t, q, y)[0] - p.row_partials(t, q, zeros)[0]
        return inverse @ force + row_terms - U @ (U.T @ row_terms)
