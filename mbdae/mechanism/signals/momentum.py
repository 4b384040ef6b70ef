"""Centre of mass and momenta of a mechanism, their rates, and the shaking force of its bodies."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import bound_bodies, require_rigid, symmetric, update_motions

MOMENTUM = {f"{word}.{x}": unit
            for word, unit in (("com", "m"), ("momentum", "kg m/s"), ("angular_momentum", "kg m^2/s"))
            for x in "xyz"}  # fmt: skip


SHAKING = {name: unit
           for word, unit in (("shaking_force", "N"), ("shaking_moment", "N m"))
           for name in (word, *(f"{word}.{x}" for x in "xyz"))}  # fmt: skip


def momentum(model: pin.Model, q: Array, v: Array) -> dict[str, Array]:
    """Return the centre of mass c, the momentum sum m_k c_k' and the angular momentum about c, in world axes.

    Armature inertias, of rotors without a body, do not contribute, nor do rigid bodies fixed to the world.

    Args:
        model: a model.
        q: configurations, (n, nq).
        v: velocities, (n, nv).

    Returns:
        Columns ``com.x``, ..., ``angular_momentum.z`` (n,), with the units of `MOMENTUM`.
    """
    data, out = make_data(model), np.empty((len(q), 9))
    bodies = [(j, Y) for j, Y in enumerate(model.inertias) if j]
    fixed = [body for body in bound_bodies(data) if not body.joint]  # other flexible bodies belong to moving joints
    mass = sum(Y.mass for _, Y in bodies) + sum(body.modal.mass for body in fixed)
    for row, configuration, velocity in zip(out, q, v, strict=True):
        update_motions(model, data, configuration, velocity)
        h = _momenta_of_bodies(model, data, configuration, velocity).sum(axis=0)
        moments = [Y.mass * data.oMi[j].act(Y.lever) for j, Y in bodies]
        moments += [body.first_moment(data, configuration) for body in bound_bodies(data)]
        moments += [body.modal.mass * body.placement.act(body.modal.s0 / body.modal.mass) for body in fixed]
        c = np.sum(moments, axis=0) / (mass or np.nan)
        row[:3], row[3:6], row[6:] = c, h[:3], h[3:] - np.cross(c, h[:3])
    return dict(zip(MOMENTUM, out.T, strict=True))


class Momenta(NamedTuple):
    """Momenta that may be conserved by symmetry, with their rates, (n, 6 + nv) each.

    The first six are the sums over bodies of m c' and of the angular momentum about the origin, in world axes; they are
    followed by the components of M v.

    Attributes:
        value: the momenta.
        size: sums of the magnitudes of their terms.
        rate: d/dt of the momenta.
        rate_size: sums of the magnitudes of the terms of the rates.
    """

    value: Array
    size: Array
    rate: Array
    rate_size: Array


def momenta(model: pin.Model, q: Array, v: Array, a: Array) -> Momenta:
    """Return the momenta and their rates, from the accelerations: d/dt (M v) = M v' + (C + C^T) v.

    Args:
        model: a model.
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        a: accelerations, (n, nv).
    """
    require_rigid(model, "momenta")
    data = make_data(model, complete=True)  # for computeCoriolisMatrix
    out = Momenta(*np.empty((4, len(q), 6 + model.nv)))
    for i, (qi, vi, ai) in enumerate(zip(q, v, a, strict=True)):
        pin.forwardKinematics(model, data, qi, vi, ai)
        h, dh = _momenta_of_bodies(model, data, qi, vi), _inertia_wrenches(model, data, qi, vi, ai)
        C = pin.computeCoriolisMatrix(model, data, qi, vi)
        dM = C + C.T
        M = symmetric(pin.crba(model, data, qi))
        out.value[i] = [*h.sum(axis=0), *(M @ vi)]
        out.size[i] = [*np.abs(h).sum(axis=0), *(np.abs(M) @ np.abs(vi))]
        out.rate[i] = [*dh.sum(axis=0), *(M @ ai + dM @ vi)]
        out.rate_size[i] = [*np.abs(dh).sum(axis=0), *(np.abs(M) @ np.abs(ai) + np.abs(dM) @ np.abs(vi))]
    return out


def shaking_force(model: pin.Model, q: Array, v: Array, vdot: Array) -> dict[str, Array]:
    """Return the inertia forces of all bodies, which act on the frame in addition to their weight, and their moment.

        F = -sum_k m_k c_k'',   M = -sum_k (c_k x m_k c_k'' + (I_k w_k)'),   about the origin of the world, in its axes

    Armature inertias, of rotors without a body, do not contribute. Source: Berkof, Lowen (1969), A new method for
    completely force balancing simple linkages, J. Eng. Ind. 91.

    Args:
        model: a model.
        q: configurations, (n, nq).
        v: velocities, (n, nv).
        vdot: accelerations, (n, nv).

    Returns:
        Columns ``shaking_force``, its magnitude, ``shaking_force.x``, ..., ``shaking_moment.z`` (n,), with the units of
        `SHAKING`.
    """
    data, out = make_data(model), np.empty((len(q), 6))
    for row, configuration, velocity, acceleration in zip(out, q, v, vdot, strict=True):
        update_motions(model, data, configuration, velocity, acceleration)
        row[:] = -_inertia_wrenches(model, data, configuration, velocity, acceleration).sum(axis=0)
    sizes = np.linalg.norm(out.reshape(-1, 2, 3), axis=2)
    return dict(zip(SHAKING, np.hstack([sizes[:, :1], out[:, :3], sizes[:, 1:], out[:, 3:]]).T, strict=True))


def _momenta_of_bodies(model: pin.Model, data: pin.Data, q: Array, v: Array) -> Array:
    """Return the momenta (n, 6) of bodies and their deformations about the origin; velocities must be current."""
    bodies = list(zip(data.oMi, model.inertias, data.v, strict=False))[1:]  # nodes of flexible bodies follow
    found = [M.act(Y * w).vector for M, Y, w in bodies] + [body.momentum(data, q, v) for body in bound_bodies(data)]
    return np.array(found).reshape(-1, 6)


def _inertia_wrenches(model: pin.Model, data: pin.Data, q: Array, v: Array, a: Array) -> Array:
    """Return the rates (n, 6) of `_momenta_of_bodies`; accelerations must be current."""
    bodies = list(zip(data.oMi, model.inertias, data.v, data.a, strict=False))[1:]
    found = [M.act(Y * x + w.cross(Y * w)).vector for M, Y, w, x in bodies]
    return np.array(found + [body.inertia_wrench(data, q, v, a) for body in bound_bodies(data)]).reshape(-1, 6)
