"""Invariants and constraint residuals of a run, at many points."""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array

if TYPE_CHECKING:
    from .index2 import Index2System


def residuals(system: "Index2System", t: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return g (n, ng), G v + g_t (n, ng), and kinetic and potential energy in J (n, 2), at points (n, ...)."""
    n = len(t)
    g, rates, energies = np.empty((n, system.ng)), np.empty((n, system.ng)), np.empty((n, 2))
    for i in range(n):
        q, v = system.split(y[i])
        g[i], rates[i] = system.residual(t[i], q, v)
        energies[i] = system.energy(q, v)
    return g, rates, energies
