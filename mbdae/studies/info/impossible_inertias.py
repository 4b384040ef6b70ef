"""Inertias that no rigid body has."""

import numpy as np

from ...mechanism import Mechanism
from ...tolerances import THREE_DIGITS


def impossible_inertias(mech: Mechanism) -> tuple[str, ...]:
    """Return the joints whose bodies have a principal moment that exceeds the sum of the two others.

    A body with a moment about one axis alone does not count: in a plane the others are left out.
    """
    out = []
    for name, inertia in zip(mech.model.names, mech.model.inertias, strict=True):
        least, middle, largest = np.linalg.eigvalsh(inertia.inertia)
        if middle > THREE_DIGITS * largest and largest - least - middle > THREE_DIGITS * largest:
            out.append(name)
    return tuple(out)
