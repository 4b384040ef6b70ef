"""Directional derivatives of wrenches of closure friction, see `mbdae.mechanism.formulations.closure_friction`.

With the wrenches A (m, 6) of the slip directions of an interface, its slip u = A V, the width b of its regularization
and c = -mu r,

    F = c |lam| phi(|u|) A^T u,   dF = (d|lam|/|lam| + psi u . du/phi) F + c |lam| phi (dA^T u + A^T du)

with du = dA V + A dV, phi(x) = tanh(x/b)/x and psi = phi'/x.
"""

from copy import copy
from typing import Any

import numpy as np

from ...system import Array
from ...tolerances import TINY
from ..closures.contact import ContactHeightRow
from ..discrete_sensitivity.friction_partials import regularization_factors
from ..formulations.friction_interface import ROTATIONAL, FrictionInterface
from ..tree.frames import point_velocities
from .motion_tangent import MotionTangent


def friction_wrench(motion: MotionTangent, name: str) -> tuple[Array, Array]:
    """Return the regularized friction of a closure on its second frame, about the world's origin, (6,), and (6, m)."""
    friction, parameters = motion.system.closure_friction, motion.parameters
    F, dF = np.zeros(6), np.zeros((6, len(motion.d.t)))
    for k in friction.regularized_interfaces(name):
        interface = friction.interfaces[k]
        (V, dV), A, dA = motion.relative(interface.pair), *_slip_wrench_tangents(motion, interface)
        lam, dlam, c = motion.lam[interface.rows], motion.d.lam[interface.rows], -float(friction.coefficient[k])
        slip, dslip = A @ V, np.einsum("ijm,j->im", dA, V) + A @ dV
        size = np.sqrt(lam @ lam)
        phi, psi = regularization_factors(float(np.sqrt(slip @ slip)), interface.force.width)
        direction = A.T @ slip
        F += c * size * phi * direction
        dsize = lam @ dlam / (size + TINY)
        dF += c * phi * np.outer(direction, dsize) + c * size * psi * np.outer(direction, slip @ dslip)
        dF += c * size * phi * (np.einsum("ijm,i->jm", dA, slip) + A.T @ dslip)
    for perturbed, p, dp in zip(parameters.perturbed_friction, parameters.all, motion.d.p, strict=True):
        found = {}
        for i, other in perturbed.items():
            other.constraints.jacobian()
            found[i] = other.wrench(name, motion.v, motion.lam)
        if found:
            dF += np.outer(p.quotient(found), dp)
    return F, dF


def _slip_wrench_tangents(motion: MotionTangent, interface: FrictionInterface) -> tuple[Array, Array]:
    """Return the wrenches A (m, 6) of `FrictionInterface.slip_wrenches`, and their derivatives, (m, 6, k)."""
    pair, friction = interface.pair, interface.closure.friction
    A, (Xa, Xb) = interface.slip_wrenches(motion.system.constraints.W[:, interface.rows]), motion.pair(pair)
    dA = np.zeros((*A.shape, Xa.shape[1]))
    p, dp = pair.pb, point_velocities(Xb, pair.pb)
    if friction == "spherical":
        return A, dA
    if friction == "surface":
        constraints = motion.system.constraints
        (_, row, _), n = constraints.frame_rows[interface.closure.name].rows[0], constraints.W[:3, interface.rows.start]
        dn = np.add(*(D[0] @ X for D, X in zip(row.partials(pair), (Xa, Xb), strict=True)))[:3]
        de = -(np.einsum("im,j->ijm", dn, n) + np.einsum("i,jm->ijm", n, dn))
        p, dp = interface.contact_point(), _contact_point_derivative(interface, Xa, Xb, dp)
    else:
        axis = pair.Ra @ interface.axis
        de = np.cross(Xa[3:].T, axis).T[None]
    if friction in ROTATIONAL:
        dA[:, 3:] = de
        return A, dA
    dA[:, :3] = de
    for i, e in enumerate(A[:, :3]):
        dA[i, 3:] = np.cross(dp.T, e).T + np.cross(p, de[i].T).T
    return A, dA


def _contact_point_derivative(interface: FrictionInterface, Xa: Array, Xb: Array, dp: Array) -> Array:
    """Return the derivative of the contact point, (3, m)."""
    first = interface.closure.primitives()[0]
    if not isinstance(first, ContactHeightRow):
        return dp
    at: Any = copy(interface.pair)
    derivatives = []
    for at.Va, at.Vb in zip(Xa.T, Xb.T, strict=True):
        derivatives.append(first.lines(at).dp[:, 0])
    return np.array(derivatives).T
