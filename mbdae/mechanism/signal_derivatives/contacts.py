"""Derivatives of contact points and contact forces of rolling bodies."""

from copy import copy

import numpy as np

from ...system import Array
from ..signals.contacts import contact_force_map, rolling_body, rolling_closures
from .motion_tangent import MotionTangent


def path_derivatives(motion: MotionTangent) -> Array:
    """Return the derivatives of the contact points of `mbdae.mechanism.signals.contacts.contact_path`, (n, 3, m)."""
    mech, parameters = motion.mechanism, motion.parameters
    names, out = [c.name for c in mech.constraints], np.empty((len(rolling_closures(mech)), 3, len(motion.d.t)))
    for i, closure in enumerate(rolling_closures(mech)):
        pair, body = motion.system.constraints.frame_rows[closure.name].pair, rolling_body(mech, closure.name)
        pair.locate()
        at = copy(pair)
        for column, Xa, Xb in zip(range(len(motion.d.t)), *(X.T for X in motion.pair(pair)), strict=True):
            at.Va, at.Vb = Xa, Xb
            out[i, :, column] = body.contact_kinematics(at).dp[:, 0]
        at.Va = at.Vb = np.zeros(6)
        for p, dp in zip(parameters.all, motion.d.p, strict=True):
            if names.index(closure.name) in p.specs:
                bodies = {k: rolling_body(other, closure.name) for k, other in p.perturbed.items()}
                out[i] += np.outer(p.quotient({k: b.contact_kinematics(at).p[:, 0] for k, b in bodies.items()}), dp)
    return out


def contact_derivatives(motion: MotionTangent) -> Array:
    """Return derivatives of normal, longitudinal and lateral forces and required friction coefficients, (n, 4, m)."""
    mech = motion.mechanism
    out = np.empty((len(rolling_closures(mech)), 4, len(motion.d.t)))
    for i, closure in enumerate(rolling_closures(mech)):
        to_force, rows = contact_force_map(motion.system, closure.name), motion.system.constraints.spans[closure.name]
        (normal, *tangential), forces = to_force @ motion.lam[rows], to_force @ motion.d.lam[rows]
        normal = normal if to_force[0].any() and normal > 0 else np.nan  # friction requires compression
        size = np.hypot(*tangential)
        friction = (np.array(tangential) @ forces[1:] / (size or 1.0) - size / normal * forces[0]) / normal
        out[i] = *forces, friction
        if not to_force[0].any():
            out[i, 0] = np.nan
    return out
