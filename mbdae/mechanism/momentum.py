"""Centre of mass and momentum of a mechanism, and the shaking force of its bodies."""

import numpy as np
import pinocchio as pin

from ..system import Array
from .pinocchio_data import make_data

MOMENTUM = {f"{word}.{x}": unit
            for word, unit in (("com", "m"), ("momentum", "kg m/s"), ("angular_momentum", "kg m^2/s"))
            for x in "xyz"}  # fmt: skip

SHAKING = {name: unit
           for word, unit in (("shaking_force", "N"), ("shaking_moment", "N m"))
           for name in (word, *(f"{word}.{x}" for x in "xyz"))}  # fmt: skip


def momentum(model: pin.Model, q: Array, v: Array) -> dict[str, Array]:
    """Return the centre of mass c, the momentum sum m_k c_k' and the angular momentum about c, in world axes.

    Armature inertias, of rotors without a body, do not contribute.

    Args:
        model: a model.
        q: configurations, (n, nq).
        v: velocities, (n, nv).

    Returns:
        Columns ``com.x``, ..., ``angular_momentum.z`` (n,), with the units of `MOMENTUM`.
    """
    data, out = make_data(model), np.empty((len(q), 9))
    bodies = [(j, Y) for j, Y in enumerate(model.inertias) if j]
    mass = sum(Y.mass for _, Y in bodies)
    for row, configuration, velocity in zip(out, q, v, strict=True):
        pin.forwardKinematics(model, data, configuration, velocity)
        h = np.sum([data.oMi[j].act(Y * data.v[j]).vector for j, Y in bodies], axis=0)
        c = np.sum([Y.mass * data.oMi[j].act(Y.lever) for j, Y in bodies], axis=0) / (mass or np.nan)
        row[:3], row[3:6], row[6:] = c, h[:3], h[3:] - np.cross(c, h[:3])
    return dict(zip(MOMENTUM, out.T, strict=True))


def shaking_force(model: pin.Model, q: Array, v: Array, vdot: Array) -> dict[str, Array]:
    """Return the inertia forces of all bodies, which act on the frame beside their weight, and their moment.

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
        pin.forwardKinematics(model, data, configuration, velocity, acceleration)
        bodies = zip(data.oMi, model.inertias, data.v, data.a, strict=True)
        wrenches = [M.act(Y * a + w.cross(Y * w)).vector for M, Y, w, a in list(bodies)[1:]]
        row[:] = -np.sum(wrenches, axis=0)
    sizes = np.linalg.norm(out.reshape(-1, 2, 3), axis=2)
    return dict(zip(SHAKING, np.hstack([sizes[:, :1], out[:, :3], sizes[:, 1:], out[:, 3:]]).T, strict=True))
