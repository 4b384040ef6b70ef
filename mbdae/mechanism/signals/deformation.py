"""Displacements of nodes of flexible bodies, in axes of the body, and strain and stress of a fibre at the node."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...system import Array
from ..tree.tree_terms import flexible_bodies

if TYPE_CHECKING:
    from ..flexible.modal_body import Node


def deformation_units(model: pin.Model) -> dict[str, str]:
    """Return units of the columns ``displacement.<node>.x``, ``strain.<node>`` and ``stress.<node>``."""
    out: dict[str, str] = {}
    for name, node, _ in nodes_of(model):
        out |= {f"displacement.{name}.{axis}": "m" for axis in "xyz"}
        if node.strain is not None:
            out |= {f"strain.{name}": "1", f"stress.{name}": "N/m^2"}
    return out


def nodes_of(model: pin.Model) -> Iterator[tuple[str, "Node", slice]]:
    """Yield, for each node of the flexible bodies, its name, the node, and the slice of its modes in q."""
    for body in flexible_bodies(model):
        first = body.first_mode_joint(model).idx_q
        for name, node in zip(body.node_frames, body.modal.nodes.values(), strict=True):
            yield name, node, slice(first, first + body.modal.modes)


def deformation(model: pin.Model, q: Array) -> dict[str, Array]:
    """Return the columns of `deformation_units`, (n,) each.

        u = Phi q + (sum q_i q_j Phi2_ij)/2,   strain = u' - y theta_y' - z theta_z',   stress = E strain

    Args:
        model: a model.
        q: configurations, (n, nq).
    """
    columns: list[Array] = []
    for _, node, modes in nodes_of(model):
        x = q[:, modes]
        columns += [*np.array([node.displaced(row)[0] - node.r for row in x]).reshape(-1, 3).T]
        if node.strain is not None:
            columns += [x @ node.strain, node.modulus * (x @ node.strain)]
    return dict(zip(deformation_units(model), columns, strict=True))
