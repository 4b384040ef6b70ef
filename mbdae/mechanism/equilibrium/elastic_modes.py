"""Vibrations of flexible bodies in a mechanism: natural frequencies with the closures, at fixed configuration.

    Z^T K Z x = w^2 Z^T M Z x,   G Z = 0,   K: stiffness of the modes of flexible bodies only

With X = Z x, X^T M X = 1, the modal coordinate of a vibration in a motion is eta = X^T K q / w^2: the coordinates of
rigid-body motions have no stiffness.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...system import Array
from ...tolerances import SUM_ROUNDING
from ..tree.frames import find_joint
from ..tree.tree_terms import flexible_bodies
from .null_space import constraint_null_space

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System


class ElasticModes(NamedTuple):
    """Vibrations of flexible bodies at a configuration.

    Attributes:
        frequencies: natural frequencies w in rad/s, ascending, (m,).
        ratios: damping ratios, (m,).
        rows: eta = rows q for the coordinates of the modes, (m, k).
        iv, iq: indices of the modes among the velocities and in q, (k,).
        labels: body and mode with the largest elastic energy, ``"mode 4 of rod"``.
    """

    frequencies: Array
    ratios: Array
    rows: Array
    iv: Array
    iq: Array
    labels: tuple[str, ...]


def elastic_modes(system: "Index2System", t: float, q: Array) -> ElasticModes:
    """Return the vibrations of flexible bodies at a configuration.

    Args:
        system: a workspace of the mechanism.
        t: time in s.
        q: configuration (nq,).
    """
    mech, U = system.mechanism, system.inertia(t, q)
    names, joints, stiffness, damping = [], [], list[float](), list[float]()
    for body in flexible_bodies(mech.model):
        names += [f"mode {i + 1} of {body.name}" for i in range(body.modal.modes)]
        joints += [find_joint(mech.model, name) for name in body.mode_joints]
        stiffness += body.modal.stiffness.tolist()
        damping += body.modal.damping.tolist()
    k, d, iv, iq = (np.array(x) for x in (stiffness, damping, [j.idx_v for j in joints], [j.idx_q for j in joints]))
    free = constraint_null_space(U, system.closures(q, t)[1], mech.row_scales, mech.coordinate_scales)
    Z = free.Z[iv]
    squares, x = np.linalg.eigh(Z.T @ (k[:, None] * Z))
    elastic = squares > SUM_ROUNDING * squares[-1:].max(initial=0.0)
    X, w2 = Z @ x[:, elastic], squares[elastic]
    w = np.sqrt(w2)
    dominant = (k[:, None] * X * X).argmax(axis=0)
    ratios = np.einsum("im,i,im->m", X, d, X) / (2 * w)
    return ElasticModes(w, ratios, (k[:, None] * X / w2).T, iv, iq, tuple(names[i] for i in dominant))
