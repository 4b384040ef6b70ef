"""Dynamics terms of the joint tree in a workspace: Pinocchio's algorithms, and contributions of flexible bodies.

See `mbdae.mechanism.flexible`. A model without flexible bodies has no attribute ``flexible``.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array
from . import pinocchio_data

if TYPE_CHECKING:
    from scipy.sparse import csc_array

    from ..flexible.attach_flexible import FlexibleBody
    from ..flexible.workspace import BoundBody


def flexible_bodies(model: pin.Model | None) -> Sequence["FlexibleBody"]:
    """Return the flexible bodies of a model."""
    return getattr(model, "flexible", ())


def mode_joints(model: pin.Model) -> list[str]:
    """Return the names of the joints of all modes of flexible bodies."""
    return [name for body in flexible_bodies(model) for name in body.mode_joints]


def bound_bodies(data: pin.Data) -> Sequence["BoundBody"]:
    """Return the flexible bodies of a workspace."""
    return getattr(data, "flexible", ())


def copy_model(model: pin.Model) -> pin.Model:
    """Return a copy of a model, with its flexible bodies."""
    out = model.copy()
    if flexible_bodies(model):
        out.flexible = flexible_bodies(model)
    return out


def update_flexible(model: pin.Model, data: pin.Data) -> None:
    """Write the parameters of the flexible bodies of a model into a workspace of a model with the same structure."""
    for body, bound in zip(flexible_bodies(model), bound_bodies(data), strict=True):
        bound.write(body.modal, body.base(model)[1])


def structure_of_flexible(model: pin.Model) -> list[tuple[str, int, tuple[str, ...]]]:
    """Return name, number of modes and names of nodes of each flexible body."""
    return [(body.name, body.modal.modes, tuple(body.modal.nodes)) for body in flexible_bodies(model)]


def require_rigid(model: pin.Model | None, what: str) -> None:
    """Reject quantities that are not available for flexible bodies.

    Raises:
        InputError: names the flexible body.
    """
    for body in flexible_bodies(model):
        raise InputError(f"{what} of flexible bodies are not supported: {body.name!r}; replace it by a rigid body")


def missing_inertia(model: pin.Model, joint: str) -> str:
    """Return why the mass matrix is singular at a joint."""
    for body in flexible_bodies(model):
        if joint in body.mode_joints:
            remedy = "give the body that carries it inertia, take fewer modes, or stiffening = false"
            return f"{body.name!r} bends too far for an inertia of second order in its modes; {remedy}"
        if joint == body.name:
            return f"{joint!r} has no inertia about an axis of its joint; a beam has some about x with polar_moment"
    return "a body without inertia"


def update_poses(model: pin.Model, data: pin.Data, q: Array) -> Array:
    """Update poses and J (6, nv), and return J."""
    J = pin.computeJointJacobians(model, data, q)
    for body in bound_bodies(data):
        body.update_poses(data, q)
    return J


def update_motions(model: pin.Model, data: pin.Data, q: Array, v: Array | None = None, a: Array | None = None) -> None:
    """Update poses; with v also velocities; with v and a also accelerations for v' = a."""
    given = [x for x in (v, a) if x is not None]
    pin.forwardKinematics(model, data, q, *given)
    for body in bound_bodies(data):
        body.update_poses(data, q)
        if v is not None:
            body.update_motions(data, q, v, np.zeros(model.nv) if a is None else a)


def update_inertia(model: pin.Model, data: pin.Data, q: Array) -> Array:
    """Update poses, J and the upper triangle of M (nv, nv), and return M."""
    if model.nv > pinocchio_data.MAX_COMPLETE_NV and not data.M.size:
        data.M = np.zeros((model.nv, model.nv))  # allocated on first use: runs in the compiled core do not need it
    M = pin.crba(model, data, q, pin.Convention.WORLD)
    for body in bound_bodies(data):
        body.update_poses(data, q)
        body.add_inertia(data, q, data.M)
    return data.M if bound_bodies(data) else M


def symmetric(M: Array) -> Array:
    """Return the symmetric matrices with the upper triangles of M, (.., nv, nv)."""
    return np.triu(M) + np.triu(M, 1).swapaxes(-2, -1)


def sparse_inertia(model: pin.Model, data: pin.Data, q: Array) -> "csc_array":
    """Update poses and J, and return M (nv, nv) as a sparse matrix.

    Rigid bodies are treated by composite inertias (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section
    6.2); with flexible bodies the sparse matrix is made from the dense one.
    """
    from scipy.sparse import coo_array, csc_array

    if bound_bodies(data):
        return csc_array(symmetric(update_inertia(model, data, q)))
    J, F = update_poses(model, data, q).reshape(6, -1), np.zeros((6, model.nv))
    composite = [data.oMi[j].act(model.inertias[j]) for j in range(model.njoints)]
    rows, columns = list[int](), list[int]()
    for j in range(model.njoints - 1, 0, -1):
        composite[model.parents[j]] += composite[j]
        first = model.idx_vs[j]
        local = range(first, first + model.nvs[j])
        F[:, local] = composite[j].matrix() @ J[:, local]
        ancestors = list(model.supports[j])[1:-1]
        above = [i for a in ancestors for i in range(model.idx_vs[a], model.idx_vs[a] + model.nvs[a])]
        for k in local:
            rows += [*above, *range(first, k)]
            columns += [k] * (len(above) + k - first)
    entries = np.einsum("ij,ij->j", J[:, rows], F[:, columns])
    diagonal, i = np.einsum("ij,ij->j", J, F) + model.armature, np.arange(model.nv)
    values = np.concatenate([entries, entries, diagonal])
    return coo_array((values, (np.r_[rows, columns, i], np.r_[columns, rows, i])), shape=(model.nv, model.nv)).tocsc()


def bias(model: pin.Model, data: pin.Data, q: Array, v: Array) -> Array:
    """Return nle(q, v), (nv,)."""
    nle = pin.nonLinearEffects(model, data, q, v)
    if bound_bodies(data):
        update_poses(model, data, q)
        for body in bound_bodies(data):
            body.add_bias(data, q, v, nle)
    return nle


def inverse_dynamics(model: pin.Model, data: pin.Data, q: Array, v: Array, a: Array) -> Array:
    """Return M v' + nle(q, v) for v' = a, (nv,)."""
    if not bound_bodies(data):
        return pin.rnea(model, data, q, v, a)
    nle = bias(model, data, q, v).copy()
    return nle + symmetric(update_inertia(model, data, q)) @ a


def gravity_potential(model: pin.Model, data: pin.Data, q: Array) -> float:
    """Return the potential energy of gravity in J."""
    out = float(pin.computePotentialEnergy(model, data, q))
    gravity = model.gravity.linear
    return out - sum(float(gravity @ body.first_moment(data, q)) for body in bound_bodies(data))
