"""Partial derivatives of closure friction, see `mbdae.mechanism.formulations.closure_friction`.

An interface slips by s = S(q) v. Its friction c |F(q, lam)| phi(|s|) S^T s, phi(x) = tanh(x/w)/x, c = -mu r, has with
psi = phi'/x the variation, at constant lam of the rows in use,

    c |F| (psi (s . ds) S^T s + phi (dS^T s + S^T ds)) + c phi S^T s d|F|,   ds = dS v + S dv

Partials of S and |F| by q are sixth-order differences of these geometric terms alone. |F| depends on q for redundant
rows: it belongs to the multipliers of least norm. The partials by lam are included in L of
`mbdae.mechanism.formulations.equation_partials`.
"""

from math import tanh
from typing import TYPE_CHECKING

import numpy as np

from ...finite_differences import numerical_jacobian
from ...system import Array

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System

WIDTH = 2e-3  # rad and m, of finite differences
SMALL = 0.03  # of the width: below, series


def friction_partials(s: "Index2System", q: Array, v: Array, lam: Array, rows: Array) -> tuple[Array, Array]:
    """Return the partials of closure friction and its power by q, (n, nv), and by (v, s, w), (n, n), n = nv + ns + 1.

    lam (r,) are the multipliers of the rows in use.
    """
    levers, size = _terms(s, q, lam, rows)
    shapes = [len(S) for S in levers]
    ends = np.cumsum(shapes) * s.nv

    def flat(x: Array) -> Array:
        moved, load = _terms(s, s.manifold.integrate(q, x), lam, rows)
        return np.concatenate([*(S.ravel() for S in moved), load])

    moved = numerical_jacobian(flat, s.nv, WIDTH)
    by_q, by_v = np.zeros((s.nv, s.nv)), np.zeros((s.nv, s.nv))
    by_load, pull = np.zeros((s.nv, len(size))), np.zeros(s.nv)
    for k, (S, c, width) in enumerate(_acting(s, levers)):
        dS = moved[ends[k] - S.size : ends[k]].reshape(*S.shape, s.nv)
        slip, phi, psi = S @ v, *shape(float(np.linalg.norm(S @ v)), width)
        T, along = c * size[k], S.T @ slip
        by_slip = T * (psi * np.outer(along, slip) + phi * S.T)
        by_v += by_slip @ S
        by_q += by_slip @ np.einsum("ijm,j->im", dS, v) + T * phi * np.einsum("ijm,i->jm", dS, slip)
        by_load[:, k], pull = c * phi * along, pull + T * phi * along
    by_q += by_load @ moved[ends[-1] :]
    s.jacobian(q)  # restores the kinematics
    nv, n = s.nv, s.ny - s.nv
    K, D = np.zeros((n, nv)), np.zeros((n, n))
    K[:nv], K[-1] = by_q, v @ by_q
    D[:nv, :nv], D[-1, :nv] = by_v, v @ by_v + pull
    return K, D


def friction(s: "Index2System", q: Array, v: Array, lam: Array, rows: Array) -> Array:
    """Return the generalised friction and its power, (nv + 1,)."""
    levers, size = _terms(s, q, lam, rows)
    out = np.zeros(s.nv)
    for load, (S, c, width) in zip(size, _acting(s, levers), strict=True):
        slip = S @ v
        out += c * load * shape(float(np.linalg.norm(slip)), width)[0] * (S.T @ slip)
    return np.append(out, out @ v)


def _terms(s: "Index2System", q: Array, lam: Array, rows: Array) -> tuple[list[Array], Array]:
    """Return S (m, nv) of each sliding interface, and its |F|, (k,)."""
    s.jacobian(q)
    sliding, W = s.closure_friction, s.constraints.W
    load = sliding.normal_forces(sliding.minimum_norm_map(rows) @ lam)[0]
    active = [k for k, active in enumerate(sliding.active) if active]
    return [sliding.interfaces[k].slip_jacobian(W[:, sliding.interfaces[k].rows]) for k in active], load[active]


def _acting(s: "Index2System", levers: list[Array]) -> list[tuple[Array, float, float]]:
    """Return S, c and the width of each sliding interface."""
    active = [k for k, active in enumerate(s.closure_friction.active) if active]
    numbers = [(-float(s.closure_friction.coefficient[k]), s.closure_friction.interfaces[k].force.width) for k in active]
    return [(S, *x) for S, x in zip(levers, numbers, strict=True)]


def shape(x: float, width: float) -> tuple[float, float]:
    """Return phi = tanh(x/w)/x and phi'/x."""
    r = x / width
    if r < SMALL:
        u = r * r
        phi = 1 - u / 3 + 2 * u**2 / 15 - 17 * u**3 / 315
        return phi / width, (-2 / 3 + 8 * u / 15 - 34 * u**2 / 105 + 496 * u**3 / 2835) / width**3
    steep = tanh(r)
    return steep / x, ((1 - steep * steep) / width - steep / x) / x**2
