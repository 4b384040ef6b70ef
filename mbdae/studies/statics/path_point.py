"""Points of a path of equilibria over a load."""

from typing import NamedTuple

from ...data_types import JsonObject
from ...mechanism.equilibrium.equilibrium_equations import ForceBalance
from ...mechanism.equilibrium.spectrum import Curvature
from ...system import Array


class CriticalPoint(NamedTuple):
    """A limit point, a branch point, or a change of a contact on a path.

    Attributes:
        kind: ``"limit"``: the load has an extremum; ``"branch"``: paths intersect; ``"contact"``, ``"separation"``: a
            contact closes or opens.
        factor: factor on the load.
        q: configuration, (nq,).
        shapes: M-orthonormal motions dq without stiffness, (m, nv): at a branch point the buckling shapes, which span
            the directions of intersecting paths. m is the multiplicity; 0 at a branch point of forces without a
            potential.
        contact: name of the contact that changes.
        reverses: whether the load reverses at the point.
    """

    kind: str
    factor: float
    q: Array
    shapes: Array
    contact: str = ""
    reverses: bool = False

    @property
    def multiplicity(self) -> int:
        """Number of zero eigenvalues of the stiffness."""
        return max(1, len(self.shapes))

    def to_dict(self) -> JsonObject:
        """Return JSON data."""
        out: JsonObject = {"kind": self.kind, "factor": self.factor, "q": self.q.tolist()}
        return out | {"shapes": self.shapes.tolist(), "contact": self.contact, "reverses": self.reverses}


class PathPoint(NamedTuple):
    """A point of a path.

    Attributes:
        u: fraction of the factor's range.
        balance: the force balance.
        dq, du: tangent of the path, (nv,) and in the fraction u.
        curvature: eigenvalues of H and their signs; None for forces without a potential.
        sign: sign of the determinant of the corrector's matrix.
    """

    u: float
    balance: ForceBalance
    dq: Array
    du: float
    curvature: Curvature | None
    sign: float
