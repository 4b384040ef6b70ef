"""Derivatives of a mechanism's equations with respect to q (in the tangent), v and s, for implicit methods.

The inertial part M v' + nle comes from Pinocchio's analytic derivatives, laws know those of theirs that are exact. The
rest are difference quotients: one sweep over nv configurations serves the closures and all other forces.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ...system import Array

if TYPE_CHECKING:
    from .index2 import Descriptor

STEP = 1e-7
"""Step of the difference quotients in the tangent; a simplified Newton iteration forgives errors of this size."""

LARGEST = 100
"""Degrees of freedom for which Pinocchio's derivatives are taken; their workspace then holds 40 MB."""


class Slopes(NamedTuple):
    """Slopes of (f + G^T lam - M v', h, power) and of G v + g_t at a point; n = nv + ns + 1 and u = (v, s, w).

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


def slopes(s: "Descriptor", t: float, q: Array, u: Array, vdot: Array, lam: Array, rows: Array) -> Slopes:
    """Take the slopes of a mechanism at (t, q, u, v', lam), u = (v, s, w), lam (r,) for the rows in use (r,)."""
    nv, n = s.nv, len(u)
    v = u[:nv]
    E, K, D = np.eye(n), np.zeros((n, nv)), np.zeros((n, n))
    E[:nv, :nv], dq, dv = inertial_slopes(s.model, s.data, q, v, vdot)
    K[:nv], D[:nv, :nv] = -dq, -dv
    s.counts.M += 1
    s.counts.f += nv + n

    def at(q: Array) -> tuple[Callable[[Array], Array], Array]:
        """Return u -> (f, h, power) at a configuration, f of the rough laws alone, and G there."""
        pin.computeJointJacobians(s.model, s.data, q)
        G = s.closures()[1][rows]

        def force(u: Array) -> Array:
            return np.concatenate(s.laws.torque(t, q, u[:nv], u[nv:-1], rough))

        return force, G

    force, G = at(q)
    known, rough = s.laws.slopes(t, q, v, u[nv:-1])
    K += known[:, :nv]
    D[:, :-1] += known[:, nv:]
    f, B = force(u), np.empty_like(G)
    for j, e in enumerate(np.diag(STEP * (1 + np.abs(u)))[:-1]):
        D[:, j] += (force(u + e) - f) / e[j]
    for j, e in enumerate(STEP * np.eye(nv)):
        force, moved = at(s.manifold.integrate(q, e))
        K[:, j] += (force(u) - f) / STEP
        K[:nv, j] += lam @ (moved - G) / STEP
        B[:, j] = (moved - G) @ v / STEP
    L = np.vstack([G.T, np.zeros((n - nv - 1, len(G))), -s.g_t(t)[rows]])
    return Slopes(E, K, D, L, G, B)


def inertial_slopes(model: pin.Model, data: pin.Data, q: Array, v: Array, vdot: Array) -> tuple[Array, Array, Array]:
    """Return M and the derivatives of M v' + nle with respect to q and v, (nv, nv) each.

    Pinocchio's derivatives leave out that the axes of universal, Euler-angle and composite joints move within the
    joint, and need a workspace that grows with nv^3; models with such joints and large ones take difference quotients.
    """
    if model.nv <= LARGEST and all(_steady(j) for j in list(model.joints)[1:]):
        data = model.createData()
        pin.computeRNEADerivatives(model, data, q, v, vdot)
        return np.triu(data.M) + np.triu(data.M, 1).T, data.dtau_dq.copy(), data.dtau_dv.copy()
    M = pin.crba(model, data, q, pin.Convention.WORLD)
    M = np.triu(M) + np.triu(M, 1).T
    tau = pin.rnea(model, data, q, v, vdot).copy()
    steps = STEP * np.eye(model.nv)
    dq = np.array([pin.rnea(model, data, pin.integrate(model, q, e), v, vdot) - tau for e in steps]).T / STEP
    dv = np.array([pin.rnea(model, data, q, v + e, vdot) - tau for e in steps]).T / STEP
    return M, dq, dv


def _steady(joint: pin.JointModel) -> bool:
    """True for joints whose axes stand still in the frame of the joint."""
    name = joint.shortname().removeprefix("JointModel")
    return name in ("Spherical", "FreeFlyer", "Translation") or name.startswith(("R", "P", "H"))
