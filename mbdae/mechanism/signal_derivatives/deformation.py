"""Derivatives of displacements, strains and stresses of the nodes of flexible bodies."""

import numpy as np

from ...system import Array
from ..signals.deformation import nodes_of
from .motion_tangent import MotionTangent


def deformation_derivatives(motion: MotionTangent) -> Array:
    """Return derivatives of the columns of `mbdae.mechanism.signals.deformation`, (n, m)."""
    model, out = motion.model, list[Array]()
    rates = motion.parameters.cached("fibres", None, lambda: _fibre_rates(motion))
    for i, (_, node, modes) in enumerate(nodes_of(model)):
        x = motion.q[modes]
        first = next(j for j in model.joints if j.idx_q == modes.start and j.nq).idx_v
        dx = motion.d.q[first : first + len(x)]
        out += [*(node.displaced(x)[1] @ dx)]
        if node.strain is not None:
            strains = np.outer([1.0, node.modulus], node.strain) @ dx
            out += [*(strains + (rates[i] @ x).T @ motion.d.p)]
    return np.array(out).reshape(-1, len(motion.d.t))


def _fibre_rates(motion: MotionTangent) -> list[Array]:
    """Return for each node the derivatives of strain and stress per mode with respect to each parameter.

    They have the shape (number of parameters, 2, k).
    """

    def rows(mech: object, i: int) -> Array:
        node = list(nodes_of(mech.model))[i][1]  # type: ignore[attr-defined]
        return np.outer([1.0, node.modulus], np.zeros(node.Phi.shape[1]) if node.strain is None else node.strain)

    count, parameters = len(list(nodes_of(motion.model))), motion.parameters.all
    return [
        np.array([p.rate(lambda m, i=i: rows(m, i)) for p in parameters])  # type: ignore[misc]
        .reshape(len(parameters), 2, -1)
        for i in range(count)
    ]
