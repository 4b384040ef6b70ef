"""Inertia of a body from a file, validated before it is passed to Pinocchio."""

import numpy as np
import pinocchio as pin

from ....errors import InputError
from ....system import Array
from ....tolerances import SOLUTION_ROUNDING


def checked_inertia(mass: float, com: Array, tensor: Array, name: str) -> pin.Inertia:
    """Return the inertia of a mass, its centre (3,) in m, and its tensor (3, 3) about that centre in kg m^2.

    Args:
        mass: mass in kg.
        com: centre of mass, (3,).
        tensor: symmetric, (3, 3).
        name: name of the body, for messages.

    Raises:
        InputError: for a negative mass, or a tensor that is not positive semi-definite.
    """
    if mass < 0:
        raise InputError(f"the mass of {name} is negative: {mass:g} kg")
    size = np.abs(tensor).max()
    if np.isfinite(size) and np.linalg.eigvalsh(tensor).min() < -SOLUTION_ROUNDING * size:
        raise InputError(f"the inertia of {name} is not positive semi-definite")
    return pin.Inertia(mass, com, tensor)
