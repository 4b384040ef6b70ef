"""Exact derivatives of the inertia forces of flexible bodies, M v' + nle, with respect to q in the tangent and to v.

With F(q, nu, A) the force on frame and modes in the axes of the frame (`modal_body`), J_k the columns that move the
frame, V its velocity, V_m the velocity after joint m, V_< and A_< velocity and acceleration, minus gravity, of the
parent of m, all about the world's origin,

    d(J_k . F)/dq_m = J_k . F'(psi, A_< x J_m + V_< x psi + psi x V) + J_k . (J_m x* F)  if k < m,   psi = V_< x J_m
    d(J_k . F)/dv_m = J_k . F'(J_m, psi + V_m x J_m + J_m x V)

where F'(dnu, dA) is a directional derivative, here a complex step. Source: see `native/mechanism/rnea_partials.hpp`.
"""

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.frames import motion_cross, wrench_matrix
from ..tree.wrench_partials import COMPLEX_STEP
from .workspace import BoundBody


def inertial_partials(
    body: BoundBody, data: pin.Data, joints: Array, q: Array, v: Array, vdot: Array, base_acceleration: Array
) -> tuple[Array, Array]:
    """Return the derivatives of the terms of a body with respect to q and v, (nv, nv) each.

    J and the pose of its frame must be current.

    Args:
        body: the body, bound to the workspace ``data``.
        data: a workspace.
        joints: joint of each velocity in the expanded tree, (nv,).
        q: configuration.
        v: velocities.
        vdot: accelerations.
        base_acceleration: minus gravity, (6,), or 0.
    """
    J, base, modal = data.J.reshape(6, -1), body.base.tolist(), body.modal
    X = body.pose(data).actionInverse
    V, A, columns = np.zeros(6), base_acceleration.copy(), []
    for joint in dict.fromkeys(joints[base]):
        group = [k for k in base if joints[k] == joint]
        V_before, A_before = V.copy(), A.copy()
        V = V + J[:, group] @ v[group]
        for k in group:
            psi, product = motion_cross(V_before, J[:, k]), motion_cross(V, J[:, k])
            columns.append((k, psi, motion_cross(A_before, J[:, k]) + motion_cross(V_before, psi), psi + product))
            A = A + product * v[k] + J[:, k] * vdot[k]
    at, k = body.at, modal.modes
    x, nu, rates = q[body.iq], np.concatenate([X @ V, v[at]]), np.concatenate([X @ A, vdot[at]])
    B = np.zeros((6 + k, len(v)))  # velocities of frame and modes, in the axes of the frame
    B[:6, base], B[6:, at] = X @ J[:, base], np.eye(k)
    force = X.T @ modal.inertial_force(x, nu, rates)[:6]
    by_q, by_v = np.zeros((2, len(v), len(v)))
    zero = np.zeros(6 + k)

    def derivative_along(dx: Array, dnu: Array, dA: Array) -> Array:
        step = 1j * COMPLEX_STEP
        force = modal.inertial_force(x + step * dx, nu + step * dnu, rates + step * dA)
        return B.T @ (force.imag / COMPLEX_STEP)

    def frame_rates(motion: Array) -> Array:
        return np.concatenate([X @ motion, zero[6:]])

    for m, psi, psi2, rate in columns:
        by_q[:, m] = derivative_along(zero[6:], frame_rates(psi), frame_rates(psi2 + motion_cross(psi, V)))
        by_v[:, m] = derivative_along(zero[6:], B[:, m], frame_rates(rate + motion_cross(J[:, m], V)))
        rotated = wrench_matrix(force) @ J[:, m]
        before = [c for c in base if joints[c] != joints[m] and c < m]
        by_q[before, m] += rotated @ J[:, before]
    for i in range(k):
        unit = np.eye(k)[i]
        by_q[:, at.start + i] = derivative_along(unit, zero, zero)
        by_v[:, at.start + i] = derivative_along(zero[6:], np.concatenate([zero[:6], unit]), zero)
    return by_q, by_v
