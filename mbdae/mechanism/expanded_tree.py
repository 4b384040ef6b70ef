"""Expanded tree: joints with configuration-dependent axes become chains of joints with fixed axes.

Pinocchio's derivatives, and dJ_k/dq_m = J_m x J_k, hold where the axes of a joint are fixed in the joint's frame. They
do not for universal, Euler-angle (ZYX) and composite joints. In the expanded tree such a joint is a chain of elementary
joints with massless links: q, v, M, the poses of bodies and the columns of J have the same values in the same order;
only the joint indices differ.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ..errors import InputError
from ..system import Array

FactorJoint = tuple[pin.JointModel, pin.SE3]


def factor_joints(joint: pin.JointModel) -> list[FactorJoint]:
    """Return the fixed-axis joints whose chain equals a joint, each with its placement on the previous one.

    Raises:
        InputError: for a joint that is not such a chain (ellipsoid).
    """
    kind, here = joint.shortname(), pin.SE3.Identity()
    if kind == "JointModelEllipsoid":
        raise InputError("the derivatives of ellipsoid joints are not known, and implicit methods need them")
    if kind == "JointModelUniversal":
        both = joint.extract()
        return [(pin.JointModelRevoluteUnaligned(np.array(axis)), here) for axis in (both.axis1, both.axis2)]
    if kind == "JointModelSphericalZYX":
        return [(one(), here) for one in (pin.JointModelRZ, pin.JointModelRY, pin.JointModelRX)]
    if kind != "JointModelComposite":
        return [(joint, here)]
    out: list[FactorJoint] = []
    composite = joint.extract()
    for one, place in zip(composite.joints, composite.jointPlacements, strict=True):
        (first, inner), *rest = factor_joints(one)
        out += [(first, place * inner), *rest]
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
        end, place = last[model.parents[j]], model.jointPlacements[j]
        for i, (part, behind) in enumerate(chain):
            end, place = out.addJoint(end, part, place * behind, f"{model.names[j]} {i}"), pin.SE3.Identity()
        out.inertias[end] = model.inertias[j]
        last.append(end)
    out.armature = model.armature
    return out


class Branches(NamedTuple):
    """Columns of J that move only one of two frames.

    Attributes:
        at: their indices, (c,).
        sign: +1 for columns that move b, -1 for a, (c,).
        before: 1 where m <= k, else 0, (c, c) with rows m.
    """

    at: Array
    sign: Array
    before: Array


def branches(model: pin.Model, a: int, b: int) -> Branches:
    """Return the columns that move only one of two joints' bodies."""
    found: list[tuple[int, float, int]] = []
    above_a, above_b = (set(model.supports[j]) for j in (a, b))
    number = 0
    for sign, joints in ((-1.0, above_a - above_b), (1.0, above_b - above_a)):
        for j in sorted(joints):
            at = model.idx_vs[j]
            for part, _ in factor_joints(model.joints[j]):
                found += [(at + i, sign, number) for i in range(part.nv)]
                at, number = at + part.nv, number + 1
    at, signs, numbers = np.array(found).reshape(-1, 3).T
    same = signs[:, None] == signs
    return Branches(at.astype(int), signs, np.where(same & (numbers[:, None] <= numbers), 1.0, 0.0))
