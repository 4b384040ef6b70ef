"""Partial derivatives of the friction in inactive rows, see `mbdae.mechanism.formulations.slip_friction`.

A sliding contact has T = c |F| d along one no-slip row, d = +-1: dT = T (F . dF)/|F|^2 + |F| d dc.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ..formulations.slip_friction import has_slip_friction, with_slip_friction

if TYPE_CHECKING:
    from .acceleration_sensitivity import AccelerationSensitivity


def with_slip_friction_partials(
    at: "AccelerationSensitivity", q: Array, v: Array, lam: Array, dlam: Array
) -> tuple[Array, Array]:
    """Return the multipliers of all rows with friction in inactive rows, (ng,), and their partials.

    Args:
        at: the sensitivity at the point.
        q: configuration, (nq,).
        v: velocity, (nv,).
        lam: multipliers of all rows without that friction, (ng,).
        dlam: their partials with respect to (y, p, t), (ng, ny + k + 1).
    """
    s, friction = at.system, at.system.closure_friction
    if not has_slip_friction(s):
        return lam, dlam
    total, out = with_slip_friction(s, q, v, lam), dlam.copy()
    for k in np.flatnonzero(friction.active):
        if (interface := friction.interfaces[k]).force.is_exact:
            F = lam[interface.rows]
            relative = F @ dlam[interface.rows] / (F @ F or 1.0)
            out[interface.no_slip_rows] = np.outer(total[interface.no_slip_rows], relative)
    for i, (p, systems) in enumerate(zip(at.parameters.all, at.parameters.perturbed_systems, strict=True), at.ny):
        if p.forces:
            for other in systems.values():
                other.enter(s.mode)
            out[:, i] += p.quotient({j: with_slip_friction(other, q, v, lam) for j, other in systems.items()})
    return total, out
