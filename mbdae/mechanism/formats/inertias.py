"""The inertia of a body as a file states it, judged before Pinocchio takes it."""

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array

ROUNDED = 1e-12  # of the largest entry of a tensor: a negative eigenvalue as small is a rounded 0


def judged_inertia(mass: float, com: Array, tensor: Array, of: str) -> pin.Inertia:
    """The inertia of a mass, its centre (3,) in m, and its tensor (3, 3) about that centre in kg m^2.

    Args:
        mass: in kg.
        com: centre of mass, (3,).
        tensor: symmetric, (3, 3).
        of: what has it, for messages.

    Raises:
        InputError: for a negative mass, or a tensor that is not positive semi-definite.
    """
    if mass < 0:
        raise InputError(f"the mass of {of} is negative: {mass:g} kg")
    size = np.abs(tensor).max()
    if np.isfinite(size) and np.linalg.eigvalsh(tensor).min() < -ROUNDED * size:
        raise InputError(f"the inertia of {of} is not positive semi-definite")
    return pin.Inertia(mass, com, tensor)
