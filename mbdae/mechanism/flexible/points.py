"""Points of a modal body that move with its modes: nodes and outline points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...system import Array


@dataclass(frozen=True, eq=False)
class Node:
    """A point of a body: r (3,) in m, displacements Phi (3, k) and rotations Psi (3, k) of the modes.

    Phi2 (3, k, k), symmetric in the modes, adds the displacements (sum q_i q_j Phi2_ij)/2; zero if omitted. The
    strain of a fibre is strain . q with strain (k,) in 1/m, its stress the modulus in N/m^2 times the strain.
    """

    r: Array
    Phi: Array
    Psi: Array
    Phi2: Array | None = None
    strain: Array | None = None
    modulus: float = 0.0

    def displaced(self, q: Array) -> tuple[Array, Array]:
        """Return the position (3,) in the body, and its derivatives with respect to q, (3, k)."""
        by_q = self.Phi if self.Phi2 is None else self.Phi + self.Phi2 @ q
        return self.r + (self.Phi + by_q) @ q / 2, by_q


@dataclass(frozen=True, eq=False)
class OutlinePoints:
    """p points of a body that determine its size and its deflection, with displacements like those of nodes.

    Attributes:
        r, Phi: (p, 3), (p, 3, k).
        Psi: rotations (p, 3, k) of cross-sections, in order along a beam; None for other bodies.
        Phi2: (p, 3, k, k), zero if omitted.
    """

    r: Array
    Phi: Array
    Psi: Array | None = None
    Phi2: Array | None = None

    @classmethod
    def of_beam(cls, nodes: Sequence[Node]) -> "OutlinePoints":
        """Return the outline of a beam from nodes along it."""
        second = [x.Phi2 for x in nodes if x.Phi2 is not None]
        r, Phi, Psi = (np.array([getattr(x, name) for x in nodes]) for name in ("r", "Phi", "Psi"))
        return cls(r, Phi, Psi, np.array(second) if second else None)

    @classmethod
    def of_extremes(cls, r: Array, Phi: Array) -> "OutlinePoints":
        """Return the extreme points along each axis, and the points that each mode displaces the most.

        Args:
            r: points, (n, 3).
            Phi: their displacements, (n, 3, k).
        """
        extremes = np.concatenate([r.argmin(axis=0), r.argmax(axis=0), np.linalg.norm(Phi, axis=1).argmax(axis=0)])
        indices = np.unique(extremes)
        return cls(r[indices], Phi[indices])

    @property
    def sections(self) -> list[Node]:
        """Cross-sections along a beam as nodes; empty for other bodies."""
        if self.Psi is None:
            return []
        second = [None] * len(self.r) if self.Phi2 is None else list(self.Phi2)
        return [Node(*x) for x in zip(self.r, self.Phi, self.Psi, second, strict=True)]
