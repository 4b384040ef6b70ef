"""Flexible bodies in a scene: rods between their nodes, which bend with them."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.tree_terms import flexible_bodies
from .scene import Mark


def flexible_links(model: pin.Model) -> Iterator[Mark]:
    """Yield a rod between neighbouring nodes of each flexible body, of their distance in the straight body."""
    one, first = pin.SE3.Identity(), model.njoints
    for body in flexible_bodies(model):
        nodes = list(body.modal.nodes.values())
        order = np.argsort([float(np.linalg.norm(node.r)) for node in nodes], kind="stable").tolist()
        for number, (i, j) in enumerate(pairwise(order), 1):
            length = float(np.linalg.norm(nodes[j].r - nodes[i].r))
            yield Mark(f"{body.name} {number}", (first + i, one), (first + j, one), length)
        first += len(nodes)


def enlarged(model: pin.Model, q: Array, factor: float | None) -> Array:
    """Return configurations (m, nq) with the coordinates of all modes multiplied by a factor; unchanged without it."""
    if factor is None:
        return q
    out = q.copy()
    for body in flexible_bodies(model):
        first = model.joints[model.getJointId(body.mode_joints[0])].idx_q
        out[:, first : first + body.modal.modes] *= factor
    return out


def hidden_joints(model: pin.Model) -> tuple[set[int], set[int]]:
    """Return the joints of modes, which are not drawn, and those whose bodies are flexible: nodes draw these."""
    bodies = flexible_bodies(model)
    modes = {model.getJointId(name) for body in bodies for name in body.mode_joints}
    return modes, {body.base(model)[0] for body in bodies if model.existJointName(body.name)}
