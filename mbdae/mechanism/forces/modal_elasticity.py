"""Elastic and damping forces of the modes of flexible bodies."""

import pinocchio as pin

from ..tree.frames import find_joint
from ..tree.tree_terms import flexible_bodies
from .linear import LinearElement, Spring


def modal_elasticity(model: pin.Model) -> list[LinearElement]:
    """Return the law -K q - D q' of each flexible body; K and D are diagonal, the potential energy is q^T K q / 2."""
    out = []
    for body in flexible_bodies(model):
        joints = [find_joint(model, name) for name in body.mode_joints]
        springs = [Spring(j.idx_q, j.idx_v, float(k), 0.0) for j, k in zip(joints, body.modal.stiffness, strict=True)]
        damping = [(j.idx_v, float(d)) for j, d in zip(joints, body.modal.damping, strict=True) if d]
        out.append(
            LinearElement(f"{body.name} elasticity", [("tau", i, "v", i, -d) for i, d in damping], springs=springs)
        )
    return out
