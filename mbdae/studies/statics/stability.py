"""Whether an equilibrium, or a steady motion, is stable, and from what this is known."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import StepError
from ...mechanism.formulations.balance import Balance, Statics
from ...mechanism.formulations.freedom import freedom
from ...mechanism.formulations.linearization import linearize_at, spectrum
from ...system import Array
from .search import FLAT, SYMMETRIC, symmetric

GROWTH = 1e-8  # of the largest eigenvalue: growth rates below are rounding
ASIDE, LOST = 1e-2, 1e-4  # a neighbour, and what the smallest singular value falls to from there where rank is lost


@dataclass(frozen=True)
class Verdict:
    """The stability of an equilibrium.

    Attributes:
        stability: ``"stable"``, ``"unstable"``, ``"neutral"``, ``"rigid"`` or ``"singular"``.
        unstable: number of unstable motions.
        neutral: number of motions against which there is neither force nor growth.
        squares: eigenvalues of the stiffness over the mass matrix, 1/s^2, rising, (k,).
        by: ``"stiffness"`` or ``"eigenvalues"`` of the linearised motion, where damping, states or speeds matter.
    """

    stability: str
    unstable: int
    neutral: int
    squares: Array
    by: str

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "stability": self.stability,
            "unstable": self.unstable,
            "neutral": self.neutral,
            "eigenvalues": self.squares.tolist(),
            "by": self.by,
        }

    def __str__(self) -> str:
        k = len(self.squares)
        freedoms = f"{k} degree{'s' if k != 1 else ''} of freedom"
        return {
            "rigid": "no freedom is left",
            "singular": f"no verdict, the closures lose rank here ({freedoms} in this pose)",
            "stable": f"stable, {freedoms}",
            "neutral": f"neutral in {self.neutral} of {freedoms}, unstable in none",
            "unstable": f"unstable, {self.unstable} growing motion{'s' if self.unstable != 1 else ''}, {freedoms}",
        }[self.stability]


def verdict(statics: Statics, here: Balance) -> Verdict:
    """Judge a balance.

    By the stiffness where it has a potential and velocities only dissipate (Kelvin, Tait, Chetaev); by the eigenvalues
    of the linearised motion where controllers have states, forces have no potential, or speeds turn the motions.
    """
    w = symmetric(here.H)[0]
    if not len(w) and not len(here.s):
        return Verdict("rigid", 0, 0, w, "stiffness")
    if loses_rank(statics, here):
        return Verdict("singular", 0, 0, w, "stiffness")
    motion = linearize_at(statics, here)
    size, C = np.abs(here.H).max(initial=0.0), motion.damping
    potential = np.abs(here.H - here.H.T).max(initial=0.0) <= SYMMETRIC * size and not len(here.s)
    turns = np.abs(C - C.T).max(initial=0.0) > SYMMETRIC * np.abs(C).max(initial=1.0)
    dissipates = symmetric(C)[0].min(initial=0.0) >= -FLAT * np.abs(C).max(initial=1.0)
    largest = np.abs(w).max(initial=0.0)
    if potential and dissipates and (not turns or w.min() > FLAT * largest):
        return _judged(int((w < -FLAT * largest).sum()), int((np.abs(w) <= FLAT * largest).sum()), w, "stiffness")
    roots = spectrum(motion.A)
    largest = np.abs(roots).max(initial=0.0)
    growing, still = roots.real > GROWTH * largest, np.abs(roots) <= GROWTH * largest
    return _judged(int((growing & ~still).sum()), -(-int(still.sum()) // 2), w, "eigenvalues")


def loses_rank(statics: Statics, here: Balance) -> bool:
    """Whether the closures have more rank in a neighbouring pose than here."""
    Z, system = here.free.Z, statics.system
    if not Z.shape[1] or not system.ng:
        return False
    y = np.random.default_rng(0).standard_normal(Z.shape[1])
    x = Z @ y
    try:
        q = statics.close(system.manifold.integrate(here.q, ASIDE / np.abs(x).max() * x), here.s)
    except StepError:
        return True
    U = system.inertia(statics.t, q)
    beside = freedom(U, np.vstack([system.jacobian(), statics.rows, statics.asked(q, here.s)[1]]))
    return len(beside.S) > len(here.free.S) or here.free.pivot < LOST * beside.pivot


def _judged(unstable: int, neutral: int, w: Array, by: str) -> Verdict:
    return Verdict("unstable" if unstable else "neutral" if neutral else "stable", unstable, neutral, w, by)
