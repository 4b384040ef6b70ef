"""Small motions of a mechanism around an equilibrium or a steady motion, as a system of first order.

At a point with v constant along the motion, with rows that keep positions, G_p, and all rows, G,

    dq = Z_p y,   dv = W y + Z u,   G_p Z_p = 0,  G Z = 0,  G W = -B Z_p,  Z^T M W = 0,   Z^T M Z = Z_p^T M Z_p = 1
    y' = Z_p^T M ((W - ad Z_p) y + Z u),    dq' = dv - ad_v dq on quaternion and planar joints
    u' = Z^T ((K Z_p + D W) y + D Z u + S ds),    ds' = (h_q Z_p + h_v W) y + h_v Z u + h_s ds

Where all rows keep positions, u is as long as y; rows of velocity alone (rolling) leave more y than u. K contains
d(G^T lam)/dq, with the multipliers of the motion.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import InputError
from ...system import Array
from .derivatives import jacobians
from .freedom import Freedom, freedom

if TYPE_CHECKING:
    from .balance import Balance, Statics

STEADY = 1e-6  # of the largest term: what may be left of the accelerations of a steady motion
ZERO = 1e-12  # of the size of A: what stands for zero where symmetries are divided out


class LinearMotion(NamedTuple):
    """Small motions z' = A z, z = (y, u, ds), around a point.

    Attributes:
        q, v, s: the point, (nq,), (nv,), (ns,).
        A: (n, n).
        positions: Z_p, (nv, k).
        speeds: Z, (nv, m).
        follow: W, (nv, k).
        free: all rows.
        damping: Z^T D Z, (m, m).
        stiffness: -Z^T (K Z_p + D W), (m, k).
    """

    q: Array
    v: Array
    s: Array
    A: Array
    positions: Array
    speeds: Array
    follow: Array
    free: Freedom
    damping: Array
    stiffness: Array

    def state(self, dq: Array, dv: Array, ds: Array) -> Array:
        """Return z (n,) of small changes that keep the rows; dq and dv (nv,), ds (ns,)."""
        U = self.free.U
        y = (U @ self.positions).T @ (U @ dq)
        u = (U @ self.speeds).T @ (U @ (dv - self.follow @ y))
        return np.concatenate([y, u, ds])

    @property
    def back(self) -> Array:
        """The matrix of (dq, dv, ds) over z, (2 nv + ns, n)."""
        (nv, k), m, ns = self.positions.shape, self.speeds.shape[1], len(self.s)
        out = np.zeros((2 * nv + ns, k + m + ns))
        out[:nv, :k], out[nv : 2 * nv, :k] = self.positions, self.follow
        out[nv : 2 * nv, k : k + m], out[2 * nv :, k + m :] = self.speeds, np.eye(ns)
        return out


def linearize_at(statics: "Statics", here: "Balance") -> LinearMotion:
    """Linearize at a balance.

    Raises:
        InputError: where the point is no steady motion, naming the joint that accelerates.
    """
    system, v, nv = statics.system, statics.v, statics.system.nv
    system.sliding.refuse("a linearization")
    lam = here.lam
    u = np.concatenate([v, here.s, [0.0]])
    slopes = jacobians(system, statics.t, here.q, u, np.zeros(nv), lam, np.arange(system.ng))
    M, K, D = slopes.E[:nv, :nv], slopes.K[:nv], slopes.D[:nv, :nv]
    S, hq = slopes.D[:nv, nv:-1], slopes.K[nv:-1]
    hv, hs = slopes.D[nv:-1, :nv], slopes.D[nv:-1, nv:-1]
    kept = np.vstack([slopes.G, statics.rows])
    positional = np.concatenate([system.constraints.positional, np.ones(len(statics.rows), bool)])
    free = freedom(here.free.U, kept)
    Z = free.Z
    Zp = Z if positional.all() else freedom(here.free.U, kept[positional]).Z
    B = np.vstack([slopes.B, np.zeros((len(statics.rows), nv))])
    W = -free.smallest(B @ Zp) if len(kept) else np.zeros((nv, Zp.shape[1]))
    ad = np.zeros((nv, nv))
    for _, at, ad_of, _ in system.manifold.blocks:
        ad[at, at] = ad_of(v[at])
    stiffness, damping = Z.T @ (K @ Zp + D @ W), Z.T @ D @ Z
    A = np.block([
        [Zp.T @ M @ (W - ad @ Zp), Zp.T @ M @ Z, np.zeros((Zp.shape[1], len(here.s)))],
        [stiffness, damping, Z.T @ S],
        [hq @ Zp + hv @ W, hv @ Z, hs],
    ])  # fmt: skip
    return LinearMotion(here.q, v, here.s, A, Zp, Z, W, free, -damping, -stiffness)


def refuse_unsteady(statics: "Statics", here: "Balance") -> None:
    """Refuse a point that is neither an equilibrium nor a steady motion.

    Raises:
        InputError: naming the joint that accelerates.
    """
    system, v = statics.system, statics.v
    free, G = freedom(here.free.U, np.vstack([system.jacobian(here.q), statics.rows])), system.jacobian()
    pull = free.Z @ (free.Z.T @ statics.force(here.q, here.s))
    if v.any():
        if np.abs(G @ v + system.g_t(statics.t)).max(initial=0.0) > STEADY * (1 + np.abs(v).max()):
            raise InputError("these speeds do not fit the closures: give those of a steady motion")
        pull = pull - freedom(here.free.U, G).smallest(system.gamma(here.q, v, statics.t))
    if np.abs(pull).max(initial=0.0) > STEADY * (1 + here.size + np.abs(v).max() ** 2):
        worst = int(np.abs(pull).argmax())
        name, size = system.mechanism.coordinate_joint(worst), abs(pull[worst])
        raise InputError(f"this is no equilibrium and no steady motion: joint {name!r} accelerates by {size:.3g}")
    K, _, hq, _ = statics.slopes(here.q, here.s, here.lam)
    change, most = free.Z.T @ K, np.vstack([K @ v, np.abs(K) @ np.abs(v)])
    if np.abs(change @ v).max(initial=0.0) > STEADY * np.abs(free.Z.T).dot(most[1]).max(initial=1.0) or (
        np.abs(hq @ v).max(initial=0.0) > STEADY * np.abs(v).max()
    ):
        raise InputError("these speeds are not steady: the forces change along the motion")
    if len(here.s) and np.abs(statics.rates(here.q, here.s)[0]).max() > STEADY * (1 + np.abs(here.s).max()):
        raise InputError("this is no equilibrium: states of controllers or motors change")


def spectrum(A: Array, motion: int = 0) -> Array:
    """Eigenvalues of A (n, n), those of symmetries exactly 0: chains of null vectors are divided out first.

    Rounding would make the p-th root of itself of a Jordan block of p zeros.
    """
    rest, zeros = A, 0
    size = np.linalg.norm(A, 2) if A.size else 0.0
    while len(rest):
        S, Vt = np.linalg.svd(rest)[1:]
        n = int((size * ZERO >= S).sum())
        if not n:
            break
        Q = Vt[::-1].T  # null vectors first
        rest, zeros = (Q.T @ rest @ Q)[n:, n:], zeros + n
    return np.concatenate([np.zeros(zeros), np.linalg.eigvals(rest) if len(rest) else np.empty(0)])
