"""Chains of axes without bodies in between: their coordinates may differ in one pose of the body at the end.

Angles (a, b, c) about z, y and x and (a + pi, pi - b, c + pi) are one rotation. The axes may belong to one joint, or to
joints between massless links, as those of MJCF bodies with several joints.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ...system import Array

if TYPE_CHECKING:
    from ..mechanism import Mechanism

OF_SEVERAL_AXES = ("JointModelComposite", "JointModelSphericalZYX")  # kinds of joints that are chains


class AxisChain(NamedTuple):
    """A chain of axes.

    Attributes:
        before: index of the joint before the chain, 0 for the world.
        last: index of the last joint of the chain.
        columns: indices of its tangent components, (k,).
    """

    before: int
    last: int
    columns: Array


def axis_chains(mech: "Mechanism") -> list[AxisChain]:
    """Return the chains of several axes that end in a body with mass; none with a joint that a coupling reads."""
    model, links, out = mech.model, _links(mech), []
    coupled = {name for c in mech.closures for name in c.joints or ()}
    for last in (j for j in range(1, model.njoints) if model.inertias[j].mass > 0):
        joints = [last]
        while model.parents[joints[-1]] in links:
            joints.append(model.parents[joints[-1]])
        several = len(joints) > 1 or model.joints[last].shortname() in OF_SEVERAL_AXES
        if several and not coupled & {model.names[j] for j in joints}:
            columns = [np.arange(x.nv) + x.idx_v for x in (model.joints[j] for j in joints)]
            out.append(AxisChain(model.parents[joints[-1]], last, np.concatenate(columns)))
    return out


def _links(mech: "Mechanism") -> set[int]:
    """Return the joints of massless links with one child, to which nothing else is attached."""
    model, parents = mech.model, list(mech.model.parents)
    pairs = [*(c.frames for c in mech.closures), *(d.frames for d in mech.drivers)]
    named = {name for pair in pairs for name in pair or ()}
    attached = {f.parentJoint for f in model.frames if f.type == pin.FrameType.OP_FRAME or f.name in named}
    massless = {j for j in range(1, model.njoints) if not model.inertias[j].mass}
    return {j for j in massless - attached if parents.count(j) == 1}


def end_distances(mech: "Mechanism", chains: Sequence[AxisChain], q0: Array, q1: Array) -> list[float]:
    """Return the largest components of the motions of the ends of chains, in rad and characteristic lengths."""
    if not chains:
        return []
    first, second = (_placements(mech.model, chains, q) for q in (q0, q1))
    changes = [a.actInv(b) for a, b in zip(first, second, strict=True)]
    unit = mech.characteristic_length
    return [max(np.abs(x.translation).max() / unit, np.abs(pin.log3(x.rotation)).max()) for x in changes]


def _placements(model: pin.Model, chains: Sequence[AxisChain], q: Array) -> list[pin.SE3]:
    """Return the placement of the last body of each chain on the body before it."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return [data.oMi[chain.before].actInv(data.oMi[chain.last]) for chain in chains]
