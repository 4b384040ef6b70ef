"""Linearized equations of motion at an equilibrium or a steady motion.

At a point with v constant along the motion, with position rows G_p and all rows G,

    dq = Z_p y,   dv = W y + Z u,   G_p Z_p = 0,  G Z = 0,  G W = -B Z_p,  Z^T M W = 0,   Z^T M Z = Z_p^T M Z_p = 1
    y' = Z_p^T M ((W - ad Z_p) y + Z u),    dq' = dv - ad_v dq on quaternion and planar joints
    u' = Z^T ((K Z_p + D W) y + D Z u + S ds),    ds' = (h_q Z_p + h_v W) y + h_v Z u + h_s ds

If all rows are positional, y and u have the same length; with velocity rows (rolling) y is longer than u. K contains
d(G^T lam)/dq with the multipliers of the motion.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError
from ...system import Array
from ...tolerances import EPS, VISIBLE
from ..formulations.equation_partials import equation_partials
from .null_space import NullSpace, constraint_null_space

if TYPE_CHECKING:
    from .equilibrium_equations import ForceBalance, Statics


class LinearMotion(NamedTuple):
    """Perturbation equations z' = A z, z = (y, u, ds), around a point.

    Attributes:
        q, v, s: the point, (nq,), (nv,), (ns,).
        A: system matrix, (n, n).
        Zp: Z_p, a basis of the displacements dq that satisfy the position rows, (nv, k).
        Z: a basis of the velocities that satisfy all rows, (nv, m).
        W: velocities due to displacements y, (nv, k).
        free: null space of all rows.
        damping: Z^T D Z, (m, m).
        stiffness: -Z^T (K Z_p + D W), (m, k).
        noise: rounding error of each entry of A, (n, n).
    """

    q: Array
    v: Array
    s: Array
    A: Array
    Zp: Array
    Z: Array
    W: Array
    free: NullSpace
    damping: Array
    stiffness: Array
    noise: Array

    def state(self, dq: Array, dv: Array, ds: Array) -> Array:
        """Return z (n,) of perturbations that satisfy the rows; dq and dv (nv,), ds (ns,)."""
        U = self.free.U
        y = (U @ self.Zp).T @ (U @ dq)
        u = (U @ self.Z).T @ (U @ (dv - self.W @ y))
        return np.concatenate([y, u, ds])

    @property
    def perturbation_map(self) -> Array:
        """Map from z to (dq, dv, ds), (2 nv + ns, n)."""
        (nv, k), m, ns = self.Zp.shape, self.Z.shape[1], len(self.s)
        out = np.zeros((2 * nv + ns, k + m + ns))
        out[:nv, :k], out[nv : 2 * nv, :k] = self.Zp, self.W
        out[nv : 2 * nv, k : k + m], out[2 * nv :, k + m :] = self.Z, np.eye(ns)
        return out


def linearize_at(statics: "Statics", balance: "ForceBalance") -> LinearMotion:
    """Linearize at an equilibrium or a steady motion.

    Raises:
        InputError: for friction that depends on multipliers.
    """
    system, v, nv = statics.system, statics.v, statics.system.nv
    system.closure_friction.reject("a linearization")
    lam = balance.lam
    u = np.concatenate([v, balance.s, [0.0]])
    each: list[Array] = []
    partials = equation_partials(system, statics.t, balance.q, u, np.zeros(nv), lam, np.arange(system.ng), each)
    M, K, D = partials.E[:nv, :nv], partials.K[:nv], partials.D[:nv, :nv]
    S, hq = partials.D[:nv, nv:-1], partials.K[nv:-1]
    hv, hs = partials.D[nv:-1, :nv], partials.D[nv:-1, nv:-1]
    G, units = np.vstack([partials.G, statics.rows]), statics.units
    positional = np.concatenate([system.constraints.positional, np.ones(len(statics.rows), bool)])
    free = constraint_null_space(balance.free.U, G, units, statics.sizes.l)
    Z = Zp = free.Z
    if not positional.all():
        Zp = constraint_null_space(balance.free.U, G[positional], units[positional], statics.sizes.l).Z
    B = np.vstack([partials.B, np.zeros((len(statics.rows), nv))])
    W = -free.minimum_norm_solution(B @ Zp) if len(G) else np.zeros((nv, Zp.shape[1]))
    ad = np.zeros((nv, nv))
    for _, block, ad_of, _ in system.manifold.group_joints:
        ad[block, block] = ad_of(v[block])
    stiffness, damping = Z.T @ (K @ Zp + D @ W), Z.T @ D @ Z
    A = np.block([
        [Zp.T @ M @ (W - ad @ Zp), Zp.T @ M @ Z, np.zeros((Zp.shape[1], len(balance.s)))],
        [stiffness, damping, Z.T @ S],
        [hq @ Zp + hv @ W, hv @ Z, hs],
    ])  # fmt: skip
    sizes = statics.sizes
    sizes_D = np.abs(D) + sizes.partials(each)[1]
    size_D = sizes.damping(np.linalg.norm(balance.free.U, axis=0), sizes_D)
    z, zp, m = np.abs(Z), np.abs(Zp), np.abs(M)
    w = np.maximum(np.abs(W), sizes.speed * zp)  # W comes from a pseudoinverse
    noise = EPS * np.block([
        [zp.T @ m @ (w + np.abs(ad) @ zp), zp.T @ m @ z, np.zeros((zp.shape[1], len(balance.s)))],
        [z.T @ (balance.terms @ zp + size_D @ w), z.T @ size_D @ z, z.T @ np.abs(S)],
        [sizes.states(hq) @ zp + sizes.states(hv) @ w, sizes.states(hv) @ z, sizes.states(hs)],
    ])  # fmt: skip
    return LinearMotion(balance.q, v, balance.s, A, Zp, Z, W, free, -damping, -stiffness, noise)


def require_steady(statics: "Statics", balance: "ForceBalance") -> None:
    """Check for an equilibrium or a steady motion.

    The residuals of forces, velocities and rates are compared with the magnitudes of their terms, and with the changes
    of these terms over 1 rad or characteristic length of the coordinates.

    Raises:
        InputError: names the joint that accelerates.
    """
    system, v, sizes = statics.system, statics.v, statics.sizes
    G = system.jacobian(balance.q)
    free = constraint_null_space(balance.free.U, np.vstack([G, statics.rows]), statics.units, sizes.l)
    z, residual = np.abs(free.Z), free.Z @ (free.Z.T @ statics.force(balance.q, balance.s))
    if v.any():
        g_t, units = system.g_t(statics.t), statics.units[: len(G)]
        if (np.abs(G @ v + g_t) > VISIBLE * (np.abs(G) @ np.abs(v) + np.abs(g_t) + units * sizes.speed)).any():
            raise InputError("these velocities do not satisfy the closures: give those of a steady motion")
        loops = constraint_null_space(balance.free.U, G, units, sizes.l)
        residual = residual - loops.minimum_norm_solution(system.gamma(balance.q, v, statics.t))
    terms = z @ (z.T @ (balance.terms @ sizes.l)) + sizes.l * sizes.speed**2
    if (np.abs(residual) > VISIBLE * terms).any():
        worst = int((np.abs(residual) / sizes.l).argmax())
        name, size = system.mechanism.coordinate_joint(worst), abs(residual[worst])
        reason = f"joint {name!r} accelerates by {size:.3g}"
        raise InputError(f"this is neither an equilibrium nor a steady motion: {reason}")
    K, _, hq, hs = statics.partials(balance.q, balance.s, balance.lam)
    resting = v[statics.locked] == 0  # coordinates that move steadily need a constant torque
    fixed, mask = np.vstack([G, statics.rows[resting]]), np.append(np.ones(len(G), bool), resting)
    moving = constraint_null_space(balance.free.U, fixed, statics.units[mask], sizes.l).Z
    change, scale = moving.T @ K @ v, VISIBLE * sizes.speed * (np.abs(moving.T) @ (balance.terms @ sizes.l))
    if (np.abs(change) > scale).any() or (np.abs(hq @ v) > VISIBLE * sizes.speed * (np.abs(hq) @ sizes.l)).any():
        name = system.mechanism.coordinate_joint(int((np.abs(moving @ change) / sizes.l).argmax()))
        raise InputError(f"these velocities are not steady: the forces change along the motion, most at joint {name!r}")
    rate = np.abs(hq) @ sizes.l + np.abs(hs) @ np.abs(balance.s)
    if (np.abs(statics.rates(balance.q, balance.s)[0]) > VISIBLE * rate).any():
        raise InputError("this is not an equilibrium: states of controllers or motors change")
