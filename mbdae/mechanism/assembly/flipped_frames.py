"""Flipped frames: wrong assembly branches on which g vanishes, and additional rows that exclude them."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Union

import numpy as np

from ...system import Array
from ..closures.independent_rows import MANY_ROWS
from ..closures.rows import DotProduct1

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from ..formulations.index2 import Index2System

Jacobian = Union[Array, "csr_array"]  # sparse for many rows
Residuals = Callable[["Index2System", Array, float], tuple[Array, Jacobian]]


def divide_rows(G: "csr_array", divisors: Array) -> None:
    """Divide the rows of a sparse matrix by divisors (ng,), in place."""
    G.data /= divisors.repeat(np.diff(G.indptr))


def scaled_residuals(system: "Index2System", q: Array, t: float) -> tuple[Array, Jacobian]:
    """Return g and G of the position rows; lengths of rows and coordinates are in characteristic lengths."""
    rows, columns = system.mechanism.row_scales, system.mechanism.coordinate_scales
    positional = system.constraints.positional
    if np.count_nonzero(positional) > MANY_ROWS:
        g, scaled = system.sparse_closures(q, t)
        scaled.data *= columns[scaled.indices]
        divide_rows(scaled, rows)
        return (g / rows)[positional], scaled[positional]
    g, G = system.closures(q, t)
    return (g / rows)[positional], (G * columns / rows[:, None])[positional]


def residuals_with_directions(system: "Index2System", q: Array, t: float) -> tuple[Array, Jacobian]:
    """Return g and G with additional rows cos - 1 for axes that should coincide.

    These rows and their gradients vanish if all loops are closed, but not if a frame is flipped, where the sum of
    squares therefore has no minimum.
    """
    g, G = scaled_residuals(system, q, t)
    values, partials = [g], [G if isinstance(G, np.ndarray) else G.toarray()]
    for closure in system.mechanism.closures:
        bound = system.constraints.frame_rows.get(closure.name)
        if bound is None:
            continue
        cosines, W = DotProduct1(*closure.coinciding_axes()).value(bound.pair)
        values.append(cosines - 1)
        by_q = np.array([bound.pair.generalized_force(w) for w in W.T]).reshape(-1, system.nv)
        partials.append(by_q * system.mechanism.coordinate_scales)
    return np.concatenate(values), np.vstack(partials)


def flipped_closure(system: "Index2System") -> str:
    """Return the name of a closure whose rows vanish although a frame is flipped; empty if none.

    Kinematics must be current.
    """
    data = system.workspace
    for closure, (a, b) in system.mechanism.closure_anchors:
        relative = (data.oMi[a.joint].rotation @ a.R).T @ (data.oMi[b.joint].rotation @ b.R)
        if closure.flipped(relative):
            return closure.name
    return ""
