"""Partial derivatives of closure friction, see `mbdae.mechanism.formulations.closure_friction`.

The slip of an interface is u = S(q) v. The variation of its friction c |F(q, lam)| phi(|u|) S^T u, phi(x) =
tanh(x/b)/x with the width b of its regularization, c = -mu r, is with psi = phi'/x, at constant lam of the rows in use,

    c |F| (psi (u . du) S^T u + phi (dS^T u + S^T du)) + c phi S^T u d|F|,   du = dS v + S dv

Exact friction along one no-slip row has phi u = +-1 instead, and only dS^T of that row, whose partials are exact.

Other partials of S, and those of |F|, with respect to q are sixth-order differences of these terms, in the
coordinates that move the frames of an interface relative to each other: if both move together, S rotates, but the
friction does not change. If rows are redundant, |F| of the minimum-norm multipliers depends on q, and differences in
all coordinates are needed. The partials with respect to lam are included in L of
`mbdae.mechanism.formulations.equation_partials`.
"""

from math import tanh
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...finite_differences import numerical_jacobian
from ...system import Array
from ..tree.tree_terms import update_poses

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System

WIDTH = 2e-3  # width of finite differences, in rad and m
SMALL = 0.03  # fraction of the width, below which series are used


def friction_partials(s: "Index2System", q: Array, v: Array, lam: Array, rows: Array) -> tuple[Array, Array]:
    """Return the partials of closure friction and its power with respect to q, (n, nv), and (v, s, w), (n, n).

    n = nv + ns + 1; lam (r,) are the multipliers of the rows in use.
    """
    jacobians, normal_forces = _terms(s, q, lam, rows)
    by_q, by_v = np.zeros((s.nv, s.nv)), np.zeros((s.nv, s.nv))
    by_normal_force, total, along_rows = np.zeros((s.nv, len(normal_forces))), np.zeros(s.nv), np.zeros(s.ng)
    regularized, exact = [], []
    for k, (S, interface) in enumerate(zip(jacobians, _active_interfaces(s), strict=True)):
        direction, by_slip = interface.direction(S @ v)
        T = interface.factor * normal_forces[k]
        by_v += T * (S.T @ by_slip @ S)
        by_normal_force[:, k] = interface.factor * (S.T @ direction)
        total += T * (S.T @ direction)
        if interface.width:
            regularized.append((k, T * S.T @ by_slip, T * direction))
        else:
            exact.append(interface.closure)
            along_rows[interface.no_slip_rows] = T * direction
    by_q += s.constraints.partials(v, along_rows, exact)[0]
    basis = np.eye(s.nv)[_differenced_coordinates(s, rows)]

    def flat_terms(x: Array) -> Array:
        changed, normal_forces = _terms(s, s.manifold.integrate(q, x @ basis), lam, rows)
        return np.concatenate([*(changed[k].ravel() for k, *_ in regularized), normal_forces])

    if len(basis):
        terms_by_q, end = numerical_jacobian(flat_terms, len(basis), WIDTH) @ basis, 0
        for k, force_by_slip, force in regularized:
            S = jacobians[k]
            dS = terms_by_q[end : (end := end + S.size)].reshape(*S.shape, s.nv)
            by_q += force_by_slip @ np.einsum("ijm,j->im", dS, v) + np.einsum("ijm,i->jm", dS, force)
        by_q += by_normal_force @ terms_by_q[end:]
    s.jacobian(q)  # restores the kinematics
    nv, n = s.nv, s.ny - s.nv
    K, D = np.zeros((n, nv)), np.zeros((n, n))
    K[:nv], K[-1] = by_q, v @ by_q
    D[:nv, :nv], D[-1, :nv] = by_v, v @ by_v + total
    return K, D


def friction(s: "Index2System", q: Array, v: Array, lam: Array, rows: Array) -> Array:
    """Return the generalized friction force and its power, (nv + 1,)."""
    jacobians, normal_forces = _terms(s, q, lam, rows)
    out = np.zeros(s.nv)
    for N, S, interface in zip(normal_forces, jacobians, _active_interfaces(s), strict=True):
        out += interface.factor * N * (S.T @ interface.direction(S @ v)[0])
    return np.append(out, out @ v)


def _terms(s: "Index2System", q: Array, lam: Array, rows: Array) -> tuple[list[Array], Array]:
    """Return S (m, nv) of each sliding interface, and its normal force |F|, (k,)."""
    friction, W = s.closure_friction, s.constraints.W
    active = np.flatnonzero(friction.active)
    update_poses(s.model, s.workspace, q)
    s.constraints.update_wrenches(friction.interfaces[k].closure.name for k in active)
    normal_forces = friction.normal_forces(friction.minimum_norm_map(rows) @ lam)[0]
    return [friction.interfaces[k].sliding_jacobian(W) for k in active], normal_forces[active]


def _differenced_coordinates(s: "Index2System", rows: Array) -> Array:
    """Return a mask of the coordinates with respect to which differences are taken, (nv,)."""
    if len(rows) < s.ng - len(s.constraints.inactive):
        return np.ones(s.nv, bool)
    friction = s.closure_friction
    sliding = [friction.interfaces[k] for k in np.flatnonzero(friction.active)]
    mask = np.zeros(s.nv, bool)
    for pair in (p.pair for p in sliding if not p.force.is_exact):
        mask[pair.columns if pair.nodes else pair.sign != 0] = True
    return mask


class _ActiveInterface(NamedTuple):
    """A sliding interface.

    Attributes:
        factor: c = -mu r.
        width: width of the regularization in m/s or rad/s; 0 for exact friction along one no-slip row.
        slip_sign: sign of the slip along that row, (1,).
        closure: name of the closure.
        no_slip_rows: no-slip rows of the closure.
    """

    factor: float
    width: float
    slip_sign: Array
    closure: str
    no_slip_rows: slice

    def direction(self, slip: Array) -> tuple[Array, Array]:
        """Return phi u (m,) and its partial derivatives with respect to the slip u, (m, m)."""
        if not self.width:
            return self.slip_sign, np.zeros((1, 1))
        phi, psi = regularization_factors(float(np.linalg.norm(slip)), self.width)
        return phi * slip, psi * np.outer(slip, slip) + phi * np.eye(len(slip))


def _active_interfaces(s: "Index2System") -> list[_ActiveInterface]:
    """Return the sliding interfaces."""
    friction, out = s.closure_friction, []
    for k in np.flatnonzero(friction.active):
        p, factor = friction.interfaces[k], -float(friction.coefficient[k])
        width = 0.0 if p.force.is_exact else p.force.width
        out.append(_ActiveInterface(factor, width, friction.directions[k], p.closure.name, p.no_slip_rows))
    return out


def regularization_factors(x: float, width: float) -> tuple[float, float]:
    """Return phi = tanh(x/b)/x and phi'/x, b = `width`."""
    r = x / width
    if r < SMALL:
        r2 = r * r
        phi = 1 - r2 / 3 + 2 * r2**2 / 15 - 17 * r2**3 / 315
        return phi / width, (-2 / 3 + 8 * r2 / 15 - 34 * r2**2 / 105 + 496 * r2**3 / 2835) / width**3
    tanh_r = tanh(r)
    return tanh_r / x, ((1 - tanh_r * tanh_r) / width - tanh_r / x) / x**2
