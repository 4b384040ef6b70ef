"""Centre of mass and momentum of a mechanism."""

import numpy as np
import pinocchio as pin

from ..system import Array
from .pinocchio_data import make_data

MOMENTUM = {f"{word}.{x}": unit
            for word, unit in (("com", "m"), ("momentum", "kg m/s"), ("angular_momentum", "kg m^2/s"))
            for x in "xyz"}  # fmt: skip


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
