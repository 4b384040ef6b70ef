"""Physically impossible inertias, whose principal moments violate the triangle inequality."""

import numpy as np

from ...mechanism import Mechanism
from ...tolerances import THREE_DIGITS


def impossible_inertias(mech: Mechanism) -> tuple[str, ...]:
    """Return the joints of bodies with a principal moment of inertia above the sum of the remaining two.

    A single nonzero moment is accepted, since planar models omit the remaining ones.
    """
    out = []
    for name, inertia in zip(mech.model.names, mech.model.inertias, strict=True):
        least, middle, largest = np.linalg.eigvalsh(inertia.inertia)
        if middle > THREE_DIGITS * largest and largest - least - middle > THREE_DIGITS * largest:
            out.append(name)
    return tuple(out)
