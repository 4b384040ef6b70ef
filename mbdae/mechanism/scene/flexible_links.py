"""Flexible bodies in a scene: chains of straight rigid rods between their nodes."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pinocchio as pin

from ..tree.tree_terms import flexible_bodies, mode_joints
from .flexible_models import rod_nodes
from .scene import Rod


def flexible_links(model: pin.Model) -> Iterator[Rod]:
    """Yield the rods of flexible bodies, as long as in the undeformed body, for a scene with `with_rods`."""
    bodies = flexible_bodies(model)
    one, first = pin.SE3.Identity(), model.njoints + sum(len(body.node_frames) for body in bodies)
    for body in bodies:
        nodes = rod_nodes(model, body)
        lengths = [float(np.linalg.norm(b.r - a.r)) for a, b in pairwise(nodes)]
        for i, length in enumerate(lengths):
            if length > 0:
                yield Rod(f"{body.name} {i + 1}", (first + i, one), (first + i + 1, one), length)
        first += len(nodes)


def hidden_joints(model: pin.Model) -> set[int]:
    """Return the joints of modes, which are not drawn."""
    return {model.getJointId(name) for name in mode_joints(model)}


def flexible_joints(model: pin.Model) -> set[int]:
    """Return the joints whose bodies are flexible, which are drawn as rods."""
    return {body.base(model)[0] for body in flexible_bodies(model) if model.existJointName(body.name)}
