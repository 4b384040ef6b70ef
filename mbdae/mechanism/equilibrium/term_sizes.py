"""Magnitudes of the terms summed in derivatives of forces: eps times a magnitude is the rounding error of the sum.

With mu_i = sqrt(M_ii), coordinates in units of l_i (1 rad, or the mechanism's characteristic length), the stiffness of
coordinate i is known to within eps mu_i^2 rho_i, where rho_i in 1/s^2 is the largest of

    |K_ij| / (mu_i mu_j) over row and column i,   m_i / (mu_i l_i)^2,   |a_0| sqrt(m_c) / (mu_i l_i),  max (v_j / l_j)^2

with the largest moment m_i of forces and reactions on the joint of i, and the weight m_c |a_0| of its subtree. The
error of an entry K_ij is eps mu_i mu_j sqrt(rho_i rho_j), even if the sum is 0. The same applies to damping, with the
speed instead of these terms.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...system import Array

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System

DIFFERENCE_ERROR = 2e5  # error of finite differences of Python functions, in units of rounding


class TermSizes:
    """Magnitudes of the terms of a mechanism at constant velocities.

    Args:
        system: a workspace.
        v: velocities, (nv,).

    Attributes:
        l: unit scales of the coordinates, (nv,).
        speed: max |v_j / l_j| in 1/s.
    """

    def __init__(self, system: "Index2System", v: Array) -> None:
        model = system.model
        self.system, self.v, self.l = system, v, system.mechanism.coordinate_scales
        self.speed = float(np.abs(v / self.l).max(initial=0.0))
        self.starts = np.array(list(model.idx_vs)[1:], int)
        self.joint = np.repeat(np.arange(len(self.starts)), list(model.nvs)[1:])
        masses = [sum(model.inertias[i].mass for i in tree) for tree in list(model.subtrees)[1:]]
        self.weight = (float(np.linalg.norm(model.gravity.linear)) * np.sqrt(masses))[self.joint]
        self.errors = [DIFFERENCE_ERROR if law.finite_differences else 1.0 for law, _ in system.laws.acting]

    def forces(self, t: float, q: Array, s: Array) -> Array:
        """Return the sum of the magnitudes of all laws, (nv,); kinematics must be current at q and v."""
        out = np.zeros(len(self.v))
        for (law, at), error in zip(self.system.laws.acting, self.errors, strict=True):
            conservative, other, _ = law.evaluate(t, q, self.v, s[at])
            out += error * (np.abs(conservative) + np.abs(other))
        return out

    def partials(self, each: list[Array]) -> tuple[Array, Array]:
        """Return the summed magnitudes of the partials of ``each`` law with respect to q and v, (nv, nv) each."""
        nv = len(self.v)
        out = np.zeros((nv, 2 * nv))
        for D, error in zip(each, self.errors, strict=True):
            out += error * np.abs(D[:nv, : 2 * nv])
        return out[:, :nv], out[:, nv:]

    def states(self, X: Array) -> Array:
        """Return the magnitudes of the terms of partial derivatives X (ns, ...) of the state rates."""
        out = np.abs(X)
        for (law, at), error in zip(self.system.laws.acting, self.errors, strict=True):
            if law.finite_differences:
                out[at] = error * out[at].max(1, keepdims=True, initial=0.0)
        return out

    def stiffness(self, mu: Array, forces: Array, K: Array) -> Array:
        """Return the magnitudes of the terms of K, (nv, nv).

        Args:
            mu: square roots of the diagonal of M, (nv,).
            forces: magnitudes of the forces on each coordinate, (nv,).
            K: magnitudes of the partial derivatives, (nv, nv).
        """
        moments = np.maximum.reduceat(forces * self.l, self.starts)[self.joint]
        floor = np.maximum(moments / (mu * self.l), self.weight) / (mu * self.l)
        return increased_to_implied(mu, K, np.maximum(floor, self.speed**2))

    def damping(self, mu: Array, D: Array) -> Array:
        """Return the magnitudes of the terms of D, (nv, nv), from those of the partial derivatives."""
        return increased_to_implied(mu, D, np.full(len(mu), self.speed))


def increased_to_implied(mu: Array, X: Array, floor: Array) -> Array:
    """Return magnitudes X (nv, nv), increased to the bounds implied by their rows and columns (see the module)."""
    scaled = X / np.outer(mu, mu)
    rates = np.maximum(floor, np.maximum(scaled.max(0, initial=0.0), scaled.max(1, initial=0.0)))
    root = mu * np.sqrt(rates)
    return np.maximum(X, np.outer(root, root))
