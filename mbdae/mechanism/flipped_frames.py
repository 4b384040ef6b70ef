"""Closures whose rows vanish although a frame is turned over: how to see it, and rows that turn it back."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..system import Array
from .closures.rows import DotProduct1

if TYPE_CHECKING:
    from .formulations.index2 import Index2System

Residuals = Callable[["Index2System", Array, float], tuple[Array, Array]]


def closures(system: "Index2System", q: Array, t: float) -> tuple[Array, Array]:
    """Return g and G of the rows that have a g; lengths, of rows and coordinates, are in characteristic lengths."""
    g, G = system.closures(q, t)
    kept, rows, columns = system.constraints.positional, system.mechanism.row_scales, system.mechanism.coordinate_scales
    return (g / rows)[kept], (G * columns / rows[:, None])[kept]


def with_directions(system: "Index2System", q: Array, t: float) -> tuple[Array, Array]:
    """Return g and G with further rows cos - 1 for axes that shall point the same way.

    Where all is closed they vanish with their gradient. Where a frame is turned over they do not, and the sum of
    squares has no minimum there.
    """
    g, G = closures(system, q, t)
    values, slopes = [g], [G]
    for closure in system.mechanism.closures:
        part = system.constraints.frame_parts.get(closure.name)
        if part is None:
            continue
        cosines, W = DotProduct1(*closure.agreeing()).value(part.pair)
        values.append(cosines - 1)
        by_q = np.array([part.pair.torque(w) for w in W.T]).reshape(-1, system.nv)
        slopes.append(by_q * system.mechanism.coordinate_scales)
    return np.concatenate(values), np.vstack(slopes)


def flipped_closures(system: "Index2System") -> str:
    """Name of a closure whose products of axes vanish because a frame is turned over; empty for none.

    The kinematics of the workspace stand.
    """
    data = system.data
    for closure, (a, b) in system.mechanism.closure_anchors:
        relative = (data.oMi[a.joint].rotation @ a.R).T @ (data.oMi[b.joint].rotation @ b.R)
        if closure.flipped(relative):
            return closure.name
    return ""
