"""Rotations by a vector theta, E = exp([theta]x), and their derivatives, by power series.

With x = |theta| and four entire functions of x^2,

    a = (1 - cos x)/x^2,   b = (x - sin x)/x^3,   a1 = a'(x)/x,   b1 = b'(x)/x
    E = 1 + (1 - b x^2) [theta]x + a [theta]x^2,   Jr = 1 - a [theta]x + b [theta]x^2,   E' = E [Jr theta']x

Closed forms lose digits below x = 1 (b1: 1e-2 at 1e-3 rad), the series do not; rotations for which the series need more
terms are far beyond linear deformations.
"""

from typing import NamedTuple

import numpy as np

from ...system import Array
from ..tree.frames import cross, skew

TERMS = 20  # maximum number of terms of each series: accurate to rounding up to 5 rad
_ONE = np.eye(3)


class RotationVector(NamedTuple):
    """A rotation E (3, 3), its right Jacobian Jr (3, 3), theta (3,), and the functions (a, b, a1, b1)."""

    E: Array
    Jr: Array
    theta: Array
    functions: tuple[float, float, float, float]

    def jacobian_partials(self, z: Array) -> Array:
        """Return d(Jr z)/dtheta, (3, 3), for a constant z (3,)."""
        theta, (a, b, a1, b1) = self.theta, self.functions
        c = cross(theta, z)
        out = a * skew(z) - b * (skew(c) + skew(theta) @ skew(z))
        return out - np.outer(a1 * c - b1 * cross(theta, c), theta)


def rotation_vector(theta: Array) -> RotationVector:
    """Return the rotation by a vector theta (3,) in rad."""
    x2 = float(theta @ theta)
    a, b, a1, b1 = even_functions(x2)
    X = skew(theta)
    XX = X @ X
    return RotationVector(_ONE + (1 - b * x2) * X + a * XX, _ONE - a * X + b * XX, theta, (a, b, a1, b1))


def even_functions(x2: float) -> tuple[float, float, float, float]:
    """Return a, b, a1 and b1 of the square of an angle in rad."""
    a = b = a1 = b1 = 0.0
    p, before, u = 1.0, 0.0, 0.5  # x2^n, x2^(n-1) and 1/(2n + 2)!, with signs
    for n in range(TERMS):
        w, previous = u / (2 * n + 3), (a, b, a1, b1)
        a, b, a1, b1 = a + u * p, b + w * p, a1 + 2 * n * u * before, b1 + 2 * n * w * before
        if previous == (a, b, a1, b1):
            break
        p, before, u = p * x2, p, -w / (2 * n + 4)
    return a, b, a1, b1
