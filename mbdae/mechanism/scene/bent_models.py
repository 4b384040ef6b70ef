"""Models for drawing: flexible bodies with further nodes at the ends of rods, and with enlarged displacements."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from ..flexible.attach_flexible import FlexibleBody
from ..flexible.points import Node
from ..tree.tree_terms import copied, flexible_bodies


def with_rods(model: pin.Model) -> pin.Model:
    """Return a model whose workspaces have entries for the ends of rods, in the order of bodies, after all nodes."""
    bodies = flexible_bodies(model)
    rods = [{str(i): node for i, node in enumerate(rod_nodes(model, body))} for body in bodies]
    return _with_bodies(model, [*bodies, *(_with_nodes(body, nodes) for body, nodes in zip(bodies, rods, strict=True))])


def rod_nodes(model: pin.Model, body: FlexibleBody) -> list[Node]:
    """Return the ends of rods that draw a flexible body, in order.

    They are cross-sections along a beam; nodes of another body by their distance from its origin, where a rod
    begins unless the body is free.
    """
    modal = body.modal
    if modal.outline is not None and modal.outline.sections:
        return modal.outline.sections
    still = np.zeros((3, modal.modes))
    free = model.existJointName(body.name) and model.nvs[model.getJointId(body.name)] == 6
    nodes = [*([] if free else [Node(np.zeros(3), still, still)]), *modal.nodes.values()]
    return sorted(nodes, key=lambda node: float(np.linalg.norm(node.r)))


def enlarged(model: pin.Model, factor: float | None) -> pin.Model:
    """Return a model whose nodes have displacements multiplied by a factor; the same model without it."""
    if factor is None or not flexible_bodies(model):
        return model

    def moved(node: Node) -> Node:
        return replace(node, Phi=factor * node.Phi, Phi2=None if node.Phi2 is None else factor * node.Phi2)

    nodes = [{name: moved(node) for name, node in x.modal.nodes.items()} for x in flexible_bodies(model)]
    return _with_bodies(model, list(map(_with_nodes, flexible_bodies(model), nodes)))


def _with_bodies(model: pin.Model, bodies: list[FlexibleBody]) -> pin.Model:
    if not bodies:
        return model
    out = copied(model)
    out.flexible = tuple(bodies)
    return out


def _with_nodes(body: FlexibleBody, nodes: Mapping[str, Node]) -> FlexibleBody:
    return body.with_numbers(replace(body.modal, nodes=nodes))
