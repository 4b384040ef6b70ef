"""Laws of single coordinates: a formula of (q, v), whose derivatives follow by complex steps."""

from collections.abc import Sequence

import numpy as np

from ..wrench_partials import COMPLEX_STEP
from .force import Array, ForceElement, Part

Effort = tuple[Array | float, Array | float]
"""Of a spring, and other: (k,) each, or one number for all."""


class JointElement(ForceElement):
    """A law tau_i = F(q_i, v_i) of single coordinates without states.

    Args:
        name: for messages.
        rows: velocity indices i, (k,).
        columns: indices of q_i, (k,); none for a law of v alone.
    """

    def __init__(self, name: str, rows: Sequence[int], columns: Sequence[int] = ()) -> None:
        super().__init__(name)
        self.rows, self.columns = list(rows), list(columns)

    def effort(self, q: Array, v: Array) -> Effort:
        """Return the efforts at (q_i, v_i), (k,) each, real or complex; q is 0 for a law of v alone.

        The formula is analytic: |v| is `magnitude` (v), not abs (v).
        """
        raise NotImplementedError

    def _coordinates(self, q: Array, v: Array) -> tuple[Array, Array]:
        return q[self.columns] if self.columns else np.zeros(len(self.rows)), v[self.rows]

    def acting_components(self, nv: int) -> list[int]:  # noqa: D102
        return self.rows

    def torque(self, t: float, q: Array, v: Array) -> tuple[Part, Part]:  # noqa: D102
        tau = np.zeros((2, len(v)))
        tau[0, self.rows], tau[1, self.rows] = self.effort(*self._coordinates(q, v))
        return tau[0], tau[1]

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:  # noqa: D102
        nv, i, step = len(v), np.array(self.rows, int), 1j * COMPLEX_STEP
        out, (x, u) = np.zeros((nv + 1, 2 * nv)), self._coordinates(q, v)
        moved = ((0, x + step, u), (nv, x, u + step)) if self.columns else ((nv, x, u + step),)
        for first, *point in moved:
            spring, other = map(np.asarray, self.effort(*point))
            out[i, first + i] = (spring + other).imag / COMPLEX_STEP
            out[-1, first + i] = (other * point[1]).imag / COMPLEX_STEP  # of the power
        return out


def magnitude(x: Array) -> Array:
    """Return |x| as an analytic function of each side of 0, real or complex."""
    return x * np.sign(np.real(x))
