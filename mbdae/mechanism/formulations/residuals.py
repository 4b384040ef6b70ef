"""Constraint residuals and energies of a run, at many points."""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array
from ..closures.independent_rows import MANY_ROWS

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from .index2 import Index2System


def sparse_closures(system: "Index2System", q: Array, t: float) -> tuple[Array, "csr_array"]:
    """Return g(t, q) (ng,) and sparse G (ng, nv) of all rows."""
    system.update_rows(q)
    G = system.constraints.sparse_jacobian()
    return system.constraints.residual(t), G


def closures_dense_or_sparse(system: "Index2System", q: Array, t: float) -> "tuple[Array, Array | csr_array]":
    """Return g(t, q) (ng,) and G (ng, nv) of all rows, sparse if there are many."""
    return system.sparse_closures(q, t) if system.ng > MANY_ROWS else system.closures(q, t)


def residual(system: "Index2System", t: float, q: Array, v: Array) -> tuple[Array, Array]:
    """Return g(t, q) and G v + g_t of all rows, (ng,) each."""
    g, G = closures_dense_or_sparse(system, q, t)
    return g, G @ v + system.g_t(t)


def residuals(system: "Index2System", t: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return g (n, ng), G v + g_t (n, ng), and kinetic and potential energy in J (n, 2), at points (n, ...)."""
    n = len(t)
    g, rates, energies = np.empty((n, system.ng)), np.empty((n, system.ng)), np.empty((n, 2))
    for i in range(n):
        q, v = system.split(y[i])
        g[i], rates[i] = system.residual(t[i], q, v)
        energies[i] = system.energy(q, v)
    return g, rates, energies
