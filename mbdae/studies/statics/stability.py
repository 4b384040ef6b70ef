"""Stability of an equilibrium or a steady motion, and the criterion that decides it."""

from dataclasses import dataclass

import numpy as np

from ...data_types import JsonObject
from ...errors import StepError
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance, Statics
from ...mechanism.equilibrium.linearization import LinearMotion, linearize_at
from ...mechanism.equilibrium.spectrum import curvature, null_space, spectrum
from ...system import Array
from ...tolerances import COARSE
from .trust_region import symmetric, symmetric_part

PERTURBATION = 1e-2  # distance of a neighbouring pose in rad or characteristic lengths
RANK_DROP = COARSE  # fraction of the smallest singular value at a neighbouring pose, below which the rank has dropped


@dataclass(frozen=True)
class Verdict:
    """The stability of an equilibrium.

    Attributes:
        stability: ``"stable"``, ``"unstable"``, ``"neutral"``, ``"rigid"`` or ``"singular"``.
        unstable: number of unstable motions.
        neutral: number of motions without stiffness and growth.
        squares: generalized eigenvalues of stiffness and mass matrix, 1/s^2, in ascending order, (k,).
        by: criterion: ``"stiffness"``, or ``"eigenvalues"`` of the linearized motion with damping, states or speeds.
    """

    stability: str
    unstable: int
    neutral: int
    squares: Array
    by: str

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        return {
            "stability": self.stability,
            "unstable": self.unstable,
            "neutral": self.neutral,
            "eigenvalues": self.squares.tolist(),
            "by": self.by,
        }

    def __str__(self) -> str:
        k = len(self.squares)
        dof = "1 degree of freedom" if k == 1 else f"{k} degrees of freedom"
        return {
            "rigid": "no degree of freedom",
            "singular": f"no verdict, the closures lose rank here ({dof} in this pose)",
            "stable": f"stable, {dof}",
            "neutral": f"neutral, {_motions(self.neutral, 'free')}, none growing, {dof}",
            "unstable": f"unstable, {_motions(self.unstable, 'growing')}, {dof}",
        }[self.stability]


def _motions(n: int, kind: str) -> str:
    """Return a number of motions in words; rolling wheels have more free displacements than degrees of freedom."""
    return f"{n} {kind} motion{'s' if n != 1 else ''}"


def verdict(statics: Statics, balance: ForceBalance) -> Verdict:
    """Assess the stability of an equilibrium.

    The stiffness decides if forces have a potential and velocities only dissipate (Kelvin, Tait, Chetaev); the
    eigenvalues of the linearized motion for controllers with states, forces without a potential, or gyroscopic terms.
    """
    w = symmetric_part(balance.H)[0]
    if not len(w) and not len(balance.s):
        return Verdict("rigid", 0, 0, w, "stiffness")
    if loses_rank(statics, balance):
        return Verdict("singular", 0, 0, w, "stiffness")
    motion, stiffness = linearize_at(statics, balance), curvature(balance.H, balance.noise)
    (k, m), C = (motion.Zp.shape[1], motion.Z.shape[1]), motion.damping
    bound = motion.noise[k : k + m, k : k + m]
    potential = symmetric(balance.H, balance.noise) and not len(balance.s)
    gyroscopic, dissipates = not symmetric(C, bound), not curvature(C, bound).negative
    if potential and dissipates and (not gyroscopic or (stiffness.signs > 0).all()):
        return _classify(stiffness.negative, stiffness.flat, w, "stiffness")
    growing = spectrum(motion.A, motion.noise).growing
    return _classify(int(growing.sum()), _zero_modes(motion), w, "eigenvalues")


def _zero_modes(motion: LinearMotion) -> int:
    """Return the number of independent displacements y in ker A, without ker A[:, k:].

    An undamped displacement has a Jordan chain of length 2 of the eigenvalue 0, a damped one a single eigenvalue 0.
    Null vectors without a displacement are states that do not affect the motion.
    """
    k = motion.Zp.shape[1]
    velocity_null = null_space(motion.A[:, k:], motion.noise[:, k:])
    return len(null_space(motion.A, motion.noise).free) - len(velocity_null.free)


def loses_rank(statics: Statics, balance: ForceBalance) -> bool:
    """Return whether the rank of the closures is higher in a neighbouring pose."""
    Z, system = balance.free.Z, statics.system
    if not Z.shape[1] or not system.ng:
        return False
    y = np.random.default_rng(0).standard_normal(Z.shape[1])
    x = Z @ y
    try:
        x *= PERTURBATION / np.abs(x / statics.sizes.l).max()
        q = statics.project(system.manifold.integrate(balance.q, x), balance.s)
    except StepError:
        return True
    U = system.inertia(statics.t, q)
    neighbour = statics.free(U, q, balance.s)[0]
    return len(neighbour.S) > len(balance.free.S) or balance.free.smallest < RANK_DROP * neighbour.smallest


def _classify(unstable: int, neutral: int, w: Array, by: str) -> Verdict:
    return Verdict("unstable" if unstable else "neutral" if neutral else "stable", unstable, neutral, w, by)
