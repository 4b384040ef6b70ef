"""Exact first derivatives of a mechanism's equations with respect to q (in the tangent), v, s and t.

Derivatives of M v' + nle come from Pinocchio on the expanded tree, those of rows and laws from their classes: see
`mbdae.mechanism.tree.expanded_tree`, `mbdae.mechanism.tree.wrench_partials` and the modules of closures and forces.
Only Python functions of the user without partial derivatives are differentiated by central differences.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...finite_differences import numerical_jacobian
from ...system import Array
from ..tree.tree_terms import bound_bodies, update_motions, update_poses

if TYPE_CHECKING:
    from .index2 import Index2System


GAMMA_WIDTH = 1e-3  # rad or characteristic lengths: width of differences of gamma with flexible bodies


class EquationPartials(NamedTuple):
    """Partial derivatives of (f + G^T lam - M v', h, power) and G v + g_t; n = nv + ns + 1, u = (v, s, w).

    Attributes:
        E: diag(M, 1), (n, n).
        K: d(f + G^T lam - M v', h, power)/dq, (n, nv).
        D: d(f, h, power)/du, (n, n).
        L: d(G^T lam, 0, -g_t lam)/dlam, (n, r).
        G: the rows in use, (r, nv).
        B: d(G v)/dq, (r, nv).
    """

    E: Array
    K: Array
    D: Array
    L: Array
    G: Array
    B: Array


def equation_partials(
    s: "Index2System", t: float, q: Array, u: Array, vdot: Array, lam: Array, rows: Array,
    each: list[Array] | None = None,
) -> EquationPartials:
    """Return the partial derivatives at (t, q, u, v', lam), u = (v, s, w), lam (r,) for the rows in use (r,).

    Partial derivatives of the laws are appended to ``each``, see `ForceElements.partials`.
    """
    nv, n, v = s.nv, len(u), u[: s.nv]
    s.counts.M += 1
    s.counts.f += 1
    M, by_q, by_v = s.inertial.partials(q, v, vdot)
    update_poses(s.model, s.workspace, q)
    laws, G = s.laws.partials(t, q, v, u[nv:-1], each), s.jacobian()[rows]
    all_lam = np.zeros(s.ng)
    all_lam[rows] = lam
    rows_by_q, B = s.constraints.partials(v, all_lam)
    E, K, D = np.eye(n), laws[:, :nv], np.zeros((n, n))
    E[:nv, :nv], D[:, :-1] = M, laws[:, nv:]
    K[:nv] += rows_by_q - by_q
    D[:nv, :nv] -= by_v
    if s.closure_friction:  # its partials with respect to q and v are neglected, which only slows Newton's iteration
        e, speed, factor = s.closure_friction.slip_terms(v)
        to_all = s.closure_friction.minimum_norm_map(rows)
        of_lam = factor[:, None] * (s.closure_friction.normal_forces(to_all @ lam)[1] @ to_all)
        L = np.vstack([G.T + e.T @ of_lam, np.zeros((n - nv - 1, len(G))), speed @ of_lam - s.g_t(t)[rows]])
        return EquationPartials(E, K, D, L, G, B[rows])
    L = np.vstack([G.T, np.zeros((n - nv - 1, len(G))), -s.g_t(t)[rows]])
    return EquationPartials(E, K, D, L, G, B[rows])


def rate_partials(s: "Index2System", t: float, q: Array, v: Array, rows: Array) -> tuple[Array, Array]:
    """Return G and d(G v)/dq of the rows in use, (r, nv) each."""
    G = s.jacobian(q)
    return G[rows], s.constraints.partials(v, np.zeros(s.ng))[1][rows]


def gamma_partials(s: "Index2System", q: Array, v: Array) -> tuple[Array, Array]:
    """Return the partial derivatives of gamma of all rows with respect to q and v, (ng, nv) each.

    With flexible bodies they are differences of gamma: sixth-order in q, to 1e-12; exact in v, as gamma is quadratic.
    """
    if bound_bodies(s.workspace):
        return _differences_of_gamma(s, q, v)
    s.jacobian(q)
    return s.constraints.bias_partials(v)


def _differences_of_gamma(s: "Index2System", q: Array, v: Array) -> tuple[Array, Array]:
    scales, zero = s.mechanism.coordinate_scales, np.zeros(s.nv)
    speed = 1 + float(np.abs(v / scales).max())

    def gamma(dq: Array, dv: Array) -> Array:
        update_motions(s.model, s.workspace, s.manifold.integrate(q, dq * scales), v + dv * scales, zero)
        update_poses(s.model, s.workspace, s.manifold.integrate(q, dq * scales))
        return s.constraints.bias(v + dv * scales)

    by_q = numerical_jacobian(lambda x: gamma(x, zero), s.nv, GAMMA_WIDTH) / scales
    by_v = numerical_jacobian(lambda x: gamma(zero, x), s.nv, speed) / scales
    gamma(zero, zero)
    return by_q, by_v


def time_partials(s: "Index2System", t: float, q: Array, v: Array, states: Array, lam: Array) -> tuple[Array, ...]:
    """Return the time partials of (f, h, power), (nv + ns + 1,), of G v + g_t and of gamma, (ng,) each."""
    update_poses(s.model, s.workspace, q)
    out, (_, _, second) = s.laws.time_partials(t, q, v, states), s.constraints.motion(t)
    out[-1] += lam @ second
    third = np.zeros(s.ng)
    for at, driver in s.constraints.driven:
        third[at] = driver.third_derivative(t)
    return out, -second, -third
