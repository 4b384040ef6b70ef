"""Force laws of single joint coordinates, with partial derivatives by the complex-step method."""

from collections.abc import Sequence

import numpy as np

from ..tree.wrench_partials import COMPLEX_STEP
from .force import Array, ArrayOrZero, ForceElement

Effort = tuple[Array | float, Array | float]
"""The conservative and the non-conservative part, (k,) each, or scalars."""


class JointElement(ForceElement):
    """A law tau_i = F(q_i, v_i) that acts on single coordinates, without states.

    Args:
        name: name in messages.
        rows: velocity indices i, (k,).
        columns: indices of q_i, (k,); empty for a law of v alone.
    """

    def __init__(self, name: str, rows: Sequence[int], columns: Sequence[int] = ()) -> None:
        super().__init__(name)
        self.rows, self.columns = list(rows), list(columns)

    def effort(self, q: Array, v: Array) -> Effort:
        """Return both parts of tau_i at (q_i, v_i), (k,) each, real or complex; q is 0 for a law of v alone.

        The formula must be analytic: use `magnitude`, not abs, for |v|.
        """
        raise NotImplementedError

    def _coordinates(self, q: Array, v: Array) -> tuple[Array, Array]:
        return q[self.columns] if self.columns else np.zeros(len(self.rows)), v[self.rows]

    def acting_components(self, nv: int) -> list[int]:
        return self.rows

    def generalized_force(self, t: float, q: Array, v: Array) -> tuple[ArrayOrZero, ArrayOrZero]:
        tau = np.zeros((2, len(v)))
        tau[0, self.rows], tau[1, self.rows] = self.effort(*self._coordinates(q, v))
        return tau[0], tau[1]

    def partials(self, t: float, q: Array, v: Array, s: Array) -> Array:
        nv, i, step = len(v), np.array(self.rows, int), 1j * COMPLEX_STEP
        out, (x, u) = np.zeros((nv + 1, 2 * nv)), self._coordinates(q, v)
        perturbed = ((0, x + step, u), (nv, x, u + step)) if self.columns else ((nv, x, u + step),)
        for offset, *point in perturbed:
            conservative, other = map(np.asarray, self.effort(*point))
            out[i, offset + i] = (conservative + other).imag / COMPLEX_STEP
            out[-1, offset + i] = (other * point[1]).imag / COMPLEX_STEP  # gradient of the power
        return out


def magnitude(x: Array) -> Array:
    """Return |x| as a function that is analytic on either side of 0, of real or complex x."""
    return x * np.sign(np.real(x))
