"""Partial derivatives of impacts in mechanisms with closed loops.

A are the rows that obey the impact law, E their coefficients of restitution, w = v+ - v-, and P the impulses:

    M w = C^T P,   A v+ + c = -E (A v- + c),   C = A + r T for sliding contacts, whose friction is r P, r = +-mu

    [M  -C^T] [dv+]   [M dv- - (d_q(M w) - d_q(C^T P)) dq - (d_p(M w) - d_p(C^T P)) dp                         ]
    [A    0 ] [dP ] = [-E A dv- - (B(v+) + E B(v-)) dq - (Q(v+) + E Q(v-)) dp - (1 + E) c_t dt - de (A v- + c)  ]

with B(v) = d_q(A v), Q(v) = d_p(A v + c). Successive impacts at one instant are composed.

Source: M. A. Aizerman, F. R. Gantmacher, Q. J. Mech. Appl. Math. 11 (1958), for jumps of variations; F. Pfeiffer,
C. Glocker, Multibody Dynamics with Unilateral Contacts (1996), for the law.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ...tolerances import RANK
from .parameter_partials import Parameters

if TYPE_CHECKING:
    from ..hybrid.impact import RowImpact


@contextmanager
def all_rows_active(parameters: Parameters) -> Iterator[None]:
    """Evaluate partial derivatives of all rows, active or not, in the workspace of the parameters."""
    constraints = parameters.system.constraints
    inactive, constraints.inactive = constraints.inactive, np.empty(0, int)
    try:
        yield
    finally:
        constraints.inactive = inactive


def row_rate_partials(parameters: Parameters, t: float, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the partial derivatives of g and of G v + g_t of all rows with respect to (q, v, p, t).

    Both are (ng, 2 nv + k + 1).
    """
    s = parameters.system
    with all_rows_active(parameters):
        G = s.jacobian(q)
        B = s.constraints.partials(v, np.zeros(s.ng))[1]
        Q, g_p = parameters.row_partials(t, q, v)
    _, u_t, u_tt = s.constraints.motion(t)
    return np.hstack([G, np.zeros_like(G), g_p, -u_t[:, None]]), np.hstack([B, G, Q, -u_tt[:, None]])


def impact_partials(parameters: Parameters, t: float, q: Array, impacts: Sequence["RowImpact"]) -> Array:
    """Return the partial derivatives of v after successive impacts with respect to (q, v, p, t), (nv, 2 nv + k + 1)."""
    nv = parameters.system.nv
    found = np.eye(nv, 2 * nv + len(parameters) + 1, nv)
    for impact in impacts:
        found = _after_impact(parameters, t, q, impact, found)
    return found


def _after_impact(parameters: Parameters, t: float, q: Array, impact: "RowImpact", dv: Array) -> Array:
    """Return the partial derivatives of v after an impact from the derivatives before it, (nv, 2 nv + k + 1) each."""
    s, rows, E = parameters.system, impact.rows, impact.restitution[:, None]
    nv, rest, w, P = s.nv, np.zeros(s.nv), impact.after - impact.before, impact.impulses
    p_columns = slice(2 * nv, -1)
    M, dMw_dq = (x.copy() for x in s.inertial.momentum_partials(q, w))
    before, after = (row_rate_partials(parameters, t, q, v)[1][rows] for v in (impact.before, impact.after))
    with all_rows_active(parameters):
        G = s.jacobian(q)
        K = s.constraints.partials(rest, P)[0]
        states = np.array(list(s.mechanism.states.values()))
        # partials of r = f + G^T P - M w, and of f
        dr_dp, df_dp = (parameters.force_partials(t, q, rest, states, *x)[:nv] for x in ((w, P), (rest, 0 * P)))
    rhs_momentum, A, C = M @ dv, G[rows], G[rows].copy()
    rhs_momentum[:, :nv] += K - dMw_dq
    rhs_momentum[:, p_columns] += dr_dp - df_dp
    for row, normal, switch in impact.sliding:
        ratio = P[row] / P[normal]
        C[rows == normal] += ratio * G[row]
        dmu_dp = _coefficient_partials(parameters, switch, "coefficient")
        rhs_momentum[:, p_columns] += np.outer(G[row], np.sign(ratio) * P[normal] * dmu_dp)
    rhs_restitution = -after - E * before
    rhs_restitution[:, nv : 2 * nv] = 0.0  # v enters by dv
    rhs_restitution -= E * (A @ dv)
    speeds = A @ impact.before + s.g_t(t)[rows]
    for i, switch in enumerate(impact.switches):
        if switch >= 0:
            rhs_restitution[i, p_columns] -= speeds[i] * _coefficient_partials(parameters, switch, "restitution")
    dv_free, response = np.linalg.solve(M, rhs_momentum), np.linalg.solve(M, C.T)
    return dv_free + response @ np.linalg.lstsq(A @ response, rhs_restitution - A @ dv_free, rcond=RANK)[0]


def _coefficient_partials(parameters: Parameters, switch: int, name: str) -> Array:
    """Return the partial derivatives of a coefficient of a switch with respect to the parameters, (k,)."""
    values = ({k: getattr(m.switches[switch], name) for k, m in p.perturbed.items()} for p in parameters.all)
    return np.array([p.quotient(x) for p, x in zip(parameters.all, values, strict=True)], float)
