"""Models for drawing: flexible bodies with additional nodes at the ends of rods, and with scaled displacements."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from ..flexible.attach_flexible import FlexibleBody
from ..flexible.points import Node
from ..tree.tree_terms import copy_model, flexible_bodies


def with_rods(model: pin.Model) -> pin.Model:
    """Return a model whose workspaces have entries for the ends of rods, in the order of bodies, after all nodes."""
    bodies = flexible_bodies(model)
    rods = [{str(i): node for i, node in enumerate(rod_nodes(model, body))} for body in bodies]
    return _with_bodies(model, [*bodies, *(_with_nodes(body, nodes) for body, nodes in zip(bodies, rods, strict=True))])


def rod_nodes(model: pin.Model, body: FlexibleBody) -> list[Node]:
    """Return the ends of the rods that represent a flexible body, in order.

    They are cross-sections of a beam, or else the nodes of the body ordered by distance from its origin, where the
    first rod begins unless the body is free.
    """
    modal = body.modal
    if modal.outline is not None and modal.outline.sections:
        return modal.outline.sections
    zero = np.zeros((3, modal.modes))
    free = model.existJointName(body.name) and model.nvs[model.getJointId(body.name)] == 6
    nodes = [*([] if free else [Node(np.zeros(3), zero, zero)]), *modal.nodes.values()]
    return sorted(nodes, key=lambda node: float(np.linalg.norm(node.r)))


def with_scaled_deformation(model: pin.Model, factor: float | None) -> pin.Model:
    """Return a model with node displacements multiplied by a factor; the model itself for None."""
    if factor is None or not flexible_bodies(model):
        return model

    def scaled(node: Node) -> Node:
        return replace(node, Phi=factor * node.Phi, Phi2=None if node.Phi2 is None else factor * node.Phi2)

    nodes = [{name: scaled(node) for name, node in x.modal.nodes.items()} for x in flexible_bodies(model)]
    return _with_bodies(model, list(map(_with_nodes, flexible_bodies(model), nodes)))


def _with_bodies(model: pin.Model, bodies: list[FlexibleBody]) -> pin.Model:
    if not bodies:
        return model
    out = copy_model(model)
    out.flexible = tuple(bodies)
    return out


def _with_nodes(body: FlexibleBody, nodes: Mapping[str, Node]) -> FlexibleBody:
    return body.with_modal(replace(body.modal, nodes=nodes))
