"""Flexible bodies in a scene: rods that bend with them."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pinocchio as pin

from ..tree.tree_terms import flexible_bodies
from .bent_models import rod_nodes
from .scene import Mark


def flexible_links(model: pin.Model) -> Iterator[Mark]:
    """Yield the rods of flexible bodies, of their lengths in the straight body, for a scene with `with_rods`."""
    bodies = flexible_bodies(model)
    one, first = pin.SE3.Identity(), model.njoints + sum(len(body.node_frames) for body in bodies)
    for body in bodies:
        nodes = rod_nodes(model, body)
        lengths = [float(np.linalg.norm(b.r - a.r)) for a, b in pairwise(nodes)]
        for i, length in enumerate(lengths):
            if length > 0:
                yield Mark(f"{body.name} {i + 1}", (first + i, one), (first + i + 1, one), length)
        first += len(nodes)


def hidden_joints(model: pin.Model) -> tuple[set[int], set[int]]:
    """Return the joints of modes, which are not drawn, and those whose bodies are flexible: rods draw these."""
    bodies = flexible_bodies(model)
    modes = {model.getJointId(name) for body in bodies for name in body.mode_joints}
    return modes, {body.base(model)[0] for body in bodies if model.existJointName(body.name)}
