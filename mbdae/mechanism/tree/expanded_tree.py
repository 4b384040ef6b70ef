"""Expanded tree: joints with configuration-dependent axes become chains of joints with fixed axes.

Pinocchio's derivatives, and dJ_k/dq_m = J_m x J_k, hold for joints whose axes are fixed in the joint frame, but not for
universal, Euler-angle (ZYX) and composite joints. In the expanded tree such a joint is a chain of elementary
joints with massless links: q, v, M, the poses of bodies and the columns of J have the same values in the same order;
only the joint indices differ.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array

FactorJoint = tuple[pin.JointModel, pin.SE3]


def factor_joints(joint: pin.JointModel) -> list[FactorJoint]:
    """Return the fixed-axis joints whose chain equals a joint, each with its placement on the previous one.

    Raises:
        InputError: for a joint that is not such a chain (ellipsoid).
    """
    kind, identity = joint.shortname(), pin.SE3.Identity()
    if kind == "JointModelEllipsoid":
        raise InputError("the derivatives of ellipsoid joints are not known, and implicit methods need them")
    if kind == "JointModelUniversal":
        universal = joint.extract()
        axes = universal.axis1, universal.axis2
        return [(pin.JointModelRevoluteUnaligned(np.array(axis)), identity) for axis in axes]
    if kind == "JointModelSphericalZYX":
        return [(factor(), identity) for factor in (pin.JointModelRZ, pin.JointModelRY, pin.JointModelRX)]
    if kind != "JointModelComposite":
        return [(joint, identity)]
    out: list[FactorJoint] = []
    composite = joint.extract()
    for factor, placement in zip(composite.joints, composite.jointPlacements, strict=True):
        (first, inner), *rest = factor_joints(factor)
        out += [(first, placement * inner), *rest]
    return out


def expand(model: pin.Model) -> pin.Model:
    """Return the expanded tree of a model; the model itself if there is nothing to expand."""
    joints = list(model.joints)[1:]
    chains = [factor_joints(joint) for joint in joints]
    if all(chain[0][0] is joint for chain, joint in zip(chains, joints, strict=True)):
        return model
    out, last = pin.Model(), [0]
    out.gravity = model.gravity
    for j, chain in enumerate(chains, 1):
        parent, placement = last[model.parents[j]], model.jointPlacements[j]
        for i, (factor, offset) in enumerate(chain):
            parent = out.addJoint(parent, factor, placement * offset, f"{model.names[j]} {i}")
            placement = pin.SE3.Identity()
        out.inertias[parent] = model.inertias[j]
        last.append(parent)
    out.armature = model.armature
    return out


class Branches(NamedTuple):
    """Columns of J that move only one of two frames.

    Attributes:
        at: indices of the columns, (c,).
        sign: +1 for columns that move b, -1 for a, (c,).
        before: 1 where m <= k, else 0, (c, c) with rows m.
    """

    at: Array
    sign: Array
    before: Array

    def with_modes(self, modes: Array, sign: float) -> "Branches":
        """Return the branches extended by a node's translations, then rotations, due to modes of a flexible body."""
        k, c = len(modes), len(self.at)
        before = np.zeros((c + 2 * k,) * 2)
        before[:c, :c] = self.before
        before[:c, c:] = (self.sign == sign)[:, None]
        before[c : c + k, c:] = before[c + k :, c + k :] = 1.0
        at, signs = np.concatenate([self.at, modes, modes]), np.concatenate([self.sign, np.full(2 * k, sign)])
        return Branches(at, signs, before)


def branches(model: pin.Model, a: int, b: int) -> Branches:
    """Return the columns that move only one of two joints' bodies."""
    columns: list[tuple[int, float, int]] = []
    support_a, support_b = (set(model.supports[j]) for j in (a, b))
    number = 0
    for sign, joints in ((-1.0, support_a - support_b), (1.0, support_b - support_a)):
        for j in sorted(joints):
            at = model.idx_vs[j]
            for factor, _ in factor_joints(model.joints[j]):
                columns += [(at + i, sign, number) for i in range(factor.nv)]
                at, number = at + factor.nv, number + 1
    at, signs, numbers = np.array(columns).reshape(-1, 3).T
    same_branch = signs[:, None] == signs
    return Branches(at.astype(int), signs, np.where(same_branch & (numbers[:, None] <= numbers), 1.0, 0.0))
