"""A mechanism as an ordinary differential equation: accelerations solved for, in raw coordinates of q.

    q' = T(q) v,   M(q) v' = f(t, q, v) + G(q)^T lam,   0 = G v' + gamma + 2 alpha (G v + g_t) + beta^2 g

T(q) is the tangent map, the derivative of q (+) x at x = 0, (nq, nv). Neither g nor G v + g_t is kept: alpha and beta
in 1/s draw them back to zero (Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972)).
"""

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array, State
from .index2 import Index2System

if TYPE_CHECKING:
    from ..mechanism import Mechanism



class Index1System(Index2System):
    """The acceleration form of a mechanism, for solvers of y' = F(t, y) that know numbers only.

    Args:
        mechanism: what moves.
        baumgarte: alpha and beta in 1/s; zeros for none.

    Raises:
        InputError: for anything else than two numbers that are not negative.
    """

    def __init__(self, mechanism: "Mechanism", baumgarte: tuple[float, float] = (0.0, 0.0)) -> None:
        super().__init__(mechanism)
        try:
            pair = np.asarray(baumgarte, float)
        except (TypeError, ValueError):
            pair = np.empty(0)
        if pair.shape != (2,) or not (np.isfinite(pair).all() and (pair >= 0).all()):
            raise InputError(f"baumgarte is a pair (alpha, beta) in 1/s, not negative, got {baumgarte!r}")
        self.alpha, self.beta = float(pair[0]), float(pair[1])

    def gamma(self, q: Array, v: Array, t: float | None = None) -> Array:
        """Return gamma + 2 alpha (G v + g_t) + beta^2 g over all rows, (ng,); the kinematics stand at q already."""
        gamma = super().gamma(q, v, t)
        if not (self.alpha or self.beta):
            return gamma
        g, G = self.closures(None, t)
        rate = G @ v - self.constraints.motion(t)[1]
        return gamma + 2 * self.alpha * rate + self.beta**2 * g

    def settle(self, t: float, state: State) -> State:
        """Choose rows; v misses all of them by its drift, and stays as it is."""
        super().settle(t, state)
        return state

    def normal(self, y: Array) -> Array:
        """Return the point that raw coordinates stand for: quaternions and circles normalised."""
        if self.manifold.flat:
            return y
        return np.concatenate([pin.normalize(self.model, y[: self.nq]), y[self.nq :]])

    def rate(self, t: float, y: Array) -> tuple[Array, Array]:
        """Return dy/dt = (T v, v', w') in raw coordinates, (nq + nv + 1,), and lam (ng,)."""
        y = self.normal(y)
        F, lam = self.derivative(t, y)
        if self.manifold.flat:
            return F, lam
        dq = pin.tangentMap(self.model, y[: self.nq]) @ F[: self.nv]
        return np.concatenate([dq, F[self.nv :]]), lam
