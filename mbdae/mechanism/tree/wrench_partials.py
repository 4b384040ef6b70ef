"""Partial derivatives of wrenches between two frames, and of their power, w.r.t. configuration and velocity.

Only the columns J_m of joints that move exactly one of the frames contribute: a joint that moves both rotates the
wrench together with its bodies. m <= k means that the joint of m, in the expanded tree, is the joint of k or one of its
ancestors; V_<m is the velocity of the parent of m, V_j the velocity of the frame that m moves, W = V_j - V_<m. With the
products a x b of motions and a x* F of a motion and a wrench, all about the world's origin,

    dJ_k/dq_m = J_m x J_k  if m <= k, else 0             dJ_k/dt = V_k x J_k
    dV_j/dq_m = J_m x W                                  dV_j/dv_m = J_m
    dA_j/dq_m = J_m x (A_j - A_<m - V_<m x W) + V_<m x (J_m x W)       dA_j/dv_m = J_m x W + V_m x J_m  (A for v' = 0)

Velocities and accelerations are relative to the body at which both branches begin. The modes of a flexible body move a
node like two additional joints, a translation and a rotation (`BoundNode.split_columns`), whose columns change with Phi
and Jr.
Results have one entry for each velocity, ``at`` (u,), where u = c without nodes.
"""

from collections.abc import Callable
from copy import copy

import numpy as np

from ...system import Array
from .frames import Pair, motion_cross, skew, unit_gap, wrench_matrix
from .tree_terms import require_rigid

Rate = Callable[[Pair], Array]
COMPLEX_STEP = 1e-30
_SKEW = np.array([skew(e).ravel() for e in np.eye(3)])


class PairPartials:
    """Partial derivatives between two frames at a point.

    Args:
        pair: a `Pair` with current poses.
        v: velocities, (nv,).
    """

    def __init__(self, pair: Pair, v: Array) -> None:
        self.pair, (at, self.sign, self.before) = pair, pair.branches
        self.J = pair.jacobian
        self.Jv = self.J * v[at]
        self.moves_b = self.sign > 0
        self.W = self.Jv.dot(self.before.T)
        self.dV = motion_cross(self.J, self.W)  # partials of V_b or V_a
        self.at, self._sums = _sums_of_columns(at) if pair.nodes else (at, None)
        end = len(self.sign)
        for _, body, node in pair.nodes[::-1]:
            k = body.modal.modes
            translation, rotation = pair.node_changes(body, node, v[body.at])
            self.dV[:, end - k : end] += rotation
            self.dV[:, end - 2 * k : end - k] += translation
            end -= 2 * k
        self.V = self.Jv.dot(self.sign)  # V_b - V_a

    def along_columns(self, Da: Array, Db: Array) -> Array:
        """Return Db J_m if m moves b, Da J_m if it moves a, (.., c) from (.., 6)."""
        return np.where(self.moves_b, Db.dot(self.J), Da.dot(self.J))

    def generalized_force(self, F: Array, Da: Array, Db: Array, C: Array | None = None) -> Array:
        """Return the partial derivatives (c, c) of sign J^T F with respect to q.

        Args:
            F: a wrench on b, (6,); -F acts on a.
            Da: dF = Da d_a + Db d_b + C d(V_b - V_a) for motions d of the frames, (6, 6).
            Db: (6, 6).
            C: (6, 6); zero when left out.
        """
        dF = self.along_columns(Da, Db)
        if C is not None:
            dF += C.dot(self.sign * self.dV)
        J_rotation = self.J.T.dot(wrench_matrix(F)).dot(self.J)
        return self._matrix(self.sign[:, None] * (self.J.T.dot(dF) - self.before.T * J_rotation), F)

    def _matrix(self, K: Array, F: Array | None = None) -> Array:
        """Sum a matrix over columns to velocities, and add the change of node rotations under a wrench F."""
        if self._sums is None:
            return K
        out, positions = self._sums.T @ K @ self._sums, {int(k): i for i, k in enumerate(self.at)}
        for sign, body, node in self.pair.nodes if F is not None else ():
            i = np.array([positions[k] for k in range(body.at.start, body.at.stop)])
            changes = [np.add(*self.pair.node_changes(body, node, unit)) for unit in np.eye(len(i))]
            out[i[:, None], i] += sign * np.array([F @ change for change in changes])
        return out

    def force(self, F: Array) -> Array:
        """Return sign J^T F, (u,)."""
        return self._rows(self.sign * F.dot(self.J))

    def _rows(self, x: Array) -> Array:
        return x if self._sums is None else x @ self._sums

    def damping(self, C: Array) -> Array:
        """Return the partial derivatives (c, c) of sign J^T F with respect to v, for dF = C d(V_b - V_a)."""
        return self._matrix(self.sign[:, None] * self.J.T.dot(C).dot(self.J) * self.sign)

    def power(self, w: Array, Da: Array, Db: Array) -> Array:
        """Return partials (m, c) of w . (V_b - V_a) with respect to q, for wrenches w (6, m) with Da, Db (m, 6, 6)."""
        return self._rows(self.along_columns(self.V.dot(Da), self.V.dot(Db)) + w.T.dot(self.sign * self.dV))

    def bias(self, rate: Rate, w: Array, Da: Array, Db: Array) -> tuple[Array, Array]:
        """Return the partials (m, c) of w' . (V_b - V_a) + w . (A_b - A_a) with respect to q and v; w' = rate(pair)."""
        require_rigid(self.pair.model if self.pair.nodes else None, "derivatives of accelerations at nodes")
        J, sign, b = self.J, self.sign, self.moves_b
        strictly_before = self.before * (1 - self.before.T)
        V, V_before = self.Jv.dot(self.before), self.Jv.dot(strictly_before)
        A = motion_cross(V, self.Jv)
        A_before, velocities = A.dot(strictly_before), np.array([self.Jv.dot(1.0 - b), self.Jv.dot(1.0 * b)])
        A_frame = np.where(b, A.dot(1.0 * b)[:, None], A.dot(1.0 - b)[:, None])
        JW = motion_cross(J, self.W)
        dA_q = motion_cross(J, A_frame - A_before - motion_cross(V_before, self.W)) + motion_cross(V_before, JW)
        dA_v = JW + motion_cross(V, J)
        pair = copy(self.pair)
        pair.Va, pair.Vb = velocities
        dw, A_rel = rate(pair), A.dot(sign)
        by_q = self.along_columns(A_rel.dot(Da), A_rel.dot(Db)) + dw.T.dot(sign * self.dV) + w.T.dot(sign * dA_q)
        for m, (d, dV) in enumerate(zip(J.T, self.dV.T, strict=True)):
            by_q[:, m] += self.V.dot(_rate_partial(rate, pair, d, dV, moves_b=bool(b[m])))
        by_v = self.along_columns(self.V.dot(Da), self.V.dot(Db)) + dw.T.dot(sign * J) + w.T.dot(sign * dA_v)
        return by_q, by_v


def _sums_of_columns(at: Array) -> tuple[Array, Array | None]:
    """Return the distinct velocities (u,) of columns (c,), and the matrix (c, u) that sums equal ones."""
    distinct = np.unique(at)
    return distinct, (at[:, None] == distinct).astype(float)


def _rate_partial(rate: Rate, pair: Pair, d: Array, dV: Array, *, moves_b: bool) -> Array:
    """Return the derivative of dw/dt (6, m) for a motion d (6,) of one frame and a change dV (6,) of its velocity."""
    out, step = copy(pair), 1j * COMPLEX_STEP
    if moves_b:
        out.Rb, out.pb = pair.Rb + step * skew(d[3:]).dot(pair.Rb), pair.pb + step * (d[:3] + skew(d[3:]).dot(pair.pb))
        out.Vb = pair.Vb + step * dV
    else:
        out.Ra, out.pa = pair.Ra + step * skew(d[3:]).dot(pair.Ra), pair.pa + step * (d[:3] + skew(d[3:]).dot(pair.pa))
        out.Va = pair.Va + step * dV
    return rate(out).imag / COMPLEX_STEP


def line_wrench_partials(pair: Pair) -> tuple[Array, Array, Array]:
    """Return w = (n, p_b x n) (6,) with the unit vector n from a to b, and Da, Db (6, 6): dw = Da d_a + Db d_b."""
    distance, n = unit_gap(pair)
    return gap_wrench_partials(pair, n, (np.eye(3) - np.outer(n, n)) / distance)


def gap_wrench_partials(pair: Pair, F: Array, N: Array) -> tuple[Array, Array, Array]:
    """Return w = (F, p_b x F) (6,) with dF = N d(p_b - p_a), N (3, 3), and Da, Db (6, 6): dw = Da d_a + Db d_b."""
    P = skew(pair.pb)
    to_wrench = np.concatenate([np.eye(3), P])
    Da, Db = (to_wrench.dot(np.hstack([N, -N.dot(p)])) for p in (skew(pair.pa), P))
    return to_wrench.dot(F), -Da, Db + moved_line_partials(pair.pb, F[:, None])[0]


def moved_line_partials(p: Array, n: Array) -> Array:
    """Return the partials (m, 6, 6) of the wrenches (n, p x n) of constant forces n (3, m) at a moving point p (3,)."""
    out = np.zeros((n.shape[1], 6, 6))
    out[:, 3:, :3] = minus_n = -skews(n)
    out[:, 3:, 3:] = -minus_n.dot(skew(p))
    return out


def skews(n: Array) -> Array:
    """Return the matrices of n x . for the columns of n (3, m), (m, 3, 3)."""
    return n.T.dot(_SKEW).reshape(-1, 3, 3)
